"""The directive ``class-reference``: a compiled class with its members in the order of the stub.

A compiled class has no source order, so autodoc would sort its members by the alphabet.
"""

import ast
import importlib
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import surefix

STUB = Path(surefix.__file__).with_name("_core.pyi")


class ClassReference(SphinxDirective):
    """``class-reference:: surefix.Map``."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        name = self.arguments[0]
        lines = [f".. autoclass:: {name}", f"   :members: {', '.join(_members(name))}"]
        self.env.note_dependency(str(STUB))
        node = nodes.container()
        self.state.nested_parse(StringList(lines, source=name), self.content_offset, node)
        return node.children


def _members(name: str) -> list[str]:
    module, _, last = name.rpartition(".")
    cls = getattr(importlib.import_module(module), last)
    public = [member for member in vars(cls) if not member.startswith("_")]
    stub = ast.parse(STUB.read_text(encoding="utf-8"))
    order = [
        member.name
        for found in stub.body
        if isinstance(found, ast.ClassDef) and found.name == last
        for member in found.body
        if isinstance(member, ast.FunctionDef)
    ]
    return sorted(public, key=lambda member: order.index(member) if member in order else len(order))


def _whole_sentence(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Napoleon takes the text before a colon in an attribute's first line for a type, but not after
    a comment.
    """
    if what in ("attribute", "property") and lines:
        lines[:0] = ["..", ""]


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("class-reference", ClassReference)
    app.connect("autodoc-process-docstring", _whole_sentence, priority=400)
    return {"parallel_read_safe": True}
