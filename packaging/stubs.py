"""Copies the docstrings of the binding into its stub, so that editors show them: stubs.py STUB"""

import ast
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

Node = ast.ClassDef | ast.FunctionDef


def documented(stub: str, module: Any) -> Iterator[tuple[Node, str]]:
    """Each public class and function of the stub that has a docstring in the module."""

    def visit(body: list[ast.stmt], owner: Any) -> Iterator[tuple[Node, str]]:
        for node in body:
            if isinstance(node, Node) and not node.name.startswith("_"):
                thing = getattr(owner, node.name)
                if thing.__doc__:
                    yield node, inspect.cleandoc(thing.__doc__)
                if isinstance(node, ast.ClassDef):
                    yield from visit(node.body, thing)

    yield from visit(ast.parse(stub).body, module)


def with_docstrings(stub: str, module: Any) -> str:
    """The stub, each docstring of which is the module's."""
    lines = stub.splitlines()
    # From the end on, so that the numbers of the lines before stay right.
    for node, text in reversed(list(documented(stub, module))):
        first, indent = node.body[0], " " * (node.col_offset + 4)
        a_class = isinstance(node, ast.ClassDef)
        at = first.lineno - 1 if first.lineno > node.lineno else node.lineno
        if ast.get_docstring(node) is not None:
            del lines[at : first.end_lineno + a_class]
        elif not a_class:
            at = first.lineno
            lines[at - 1] = lines[at - 1].removesuffix(" ...")
        else:
            at = node.lineno
        marks = ('r"""' if "\\" in text else '"""', '"""')
        quoted = f"{marks[0]}{text}" + (f"\n{marks[1]}" if "\n" in text else marks[1])
        quoted += "\n\n" * a_class
        lines[at:at] = [f"{indent}{line}" if line else "" for line in quoted.splitlines()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    import surefix._core

    file = Path(sys.argv[1])
    made = with_docstrings(file.read_text(encoding="utf-8"), surefix._core)
    file.write_text(made, encoding="utf-8")
    print(f"Renewed {file}")
