"""The directive ``command-reference``: every command of ``surefix`` and its options, from the
program itself.
"""

import re
from typing import Any

import typer
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from surefix.cli import app


class CommandReference(SphinxDirective):
    """A section for each command, a definition for each argument and option."""

    def run(self) -> list[nodes.Node]:
        program = typer.main.get_command(app)
        text = "\n".join(_section(program, "surefix", None))
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _section(command: Any, name: str, parent: Any) -> list[str]:
    """The lines of a command's section and of its commands', in MyST."""
    context = command.context_class(command, info_name=name, parent=parent)
    path = context.command_path
    usage = " ".join([path, *command.collect_usage_pieces(context)])
    lines = [f"({path.replace(' ', '-')})=", f"## {path}", "", _plain(command.help or ""), ""]
    lines += ["```text", usage, "```", ""]
    examples = re.findall(r"(?:Example|Start with): (.*)", command.epilog or "")
    if examples:
        lines += ["For example:", "", "```sh", *examples, "```", ""]
    heading = None
    parameters = command.get_params(context)
    headings = [None, *dict.fromkeys(each.rich_help_panel for each in parameters)]
    for parameter in sorted(parameters, key=lambda each: headings.index(each.rich_help_panel)):
        # The help shows some options under a heading of their own.
        if parameter.rich_help_panel != heading and (definition := _definition(parameter, context)):
            heading = parameter.rich_help_panel
            lines += [f"**{heading}**" if heading else "**Others**", "", *definition]
        else:
            lines += _definition(parameter, context)
    for sub, below in getattr(command, "commands", {}).items():
        lines += _section(below, sub, context)
    return lines


def _definition(parameter: Any, context: Any) -> list[str]:
    record = parameter.get_help_record(context)
    if record is None or "--help" in parameter.opts:
        return []
    names, text = record
    # The help ends with brackets: the default, the bounds, whether the option is required.
    said, _, facts = text.partition("  [")
    facts = facts.removesuffix("]")
    tail = f" *({_plain(facts)})*" if facts else ""
    return [f"`{names.strip()}`", f": {_plain(said.strip())}{tail}", ""]


def _plain(text: str) -> str:
    """The text with Markdown's characters escaped, except code; options become code."""
    pieces = text.split("`")
    for index in range(0, len(pieces), 2):
        plain = re.sub(r"([*_<>\[\]])", r"\\\1", pieces[index])
        pieces[index] = re.sub(r"(?<![\w-])--[a-z][a-z-]*", r"`\g<0>`", plain)
    return "`".join(pieces)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("command-reference", CommandReference)
    return {"parallel_read_safe": True}
