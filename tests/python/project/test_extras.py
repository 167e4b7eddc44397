"""The extras: the table of the package is that of pyproject.toml, and each error names one that
helps.
"""

import ast
import re
import sys
import tomllib
from pathlib import Path

import pytest

from surefix import SurefixError
from surefix._extra import EXTRAS, Package, drawing

ROOT = Path(__file__).resolve().parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DECLARED: dict[str, list[str]] = PROJECT["optional-dependencies"]
DEVELOPERS = {"all", "docs", "dev"}


def packages(extra: str) -> set[str]:
    """The distributions of an extra, with those of the extras in it."""
    found: set[str] = set()
    for requirement in DECLARED[extra]:
        if inner := re.fullmatch(r"surefix\[(.*)\]", requirement):
            found |= set().union(*map(packages, inner[1].split(",")))
        else:
            found.add(re.split(r"[><=\[]", requirement)[0])
    return found


def test_the_table_is_that_of_the_project() -> None:
    assert set(EXTRAS) == set(DECLARED) - DEVELOPERS
    for name, extra in EXTRAS.items():
        assert {each.distribution for each in extra.packages} == packages(name), name


def test_all_is_each_of_them() -> None:
    assert packages("all") == set().union(*(packages(name) for name in EXTRAS))


def test_each_error_names_an_extra_that_has_the_package() -> None:
    found = 0
    for file in (ROOT / "python" / "surefix").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "require":
                module, install = (getattr(node.args[at], "value", None) for at in (0, 3))
                extra = re.fullmatch(r"surefix\[(\w+)\]", str(install))
                if extra and isinstance(module, str):
                    of = {each.module for each in EXTRAS[extra[1]].packages}
                    assert module.partition(".")[0] in of, (file, node.lineno)
                    found += 1
    assert found > 15


@pytest.mark.parametrize("package", EXTRAS["report"].packages, ids=lambda each: each.module)
def test_what_draws_is_refused_before_it_begins(
    package: Package, monkeypatch: pytest.MonkeyPatch
) -> None:
    for each in EXTRAS["report"].packages:
        pytest.importorskip(each.module)
    drawing()
    monkeypatch.setitem(sys.modules, package.module, None)
    with pytest.raises(SurefixError) as refused:
        drawing("the page")
    said = f'the page takes {package.title}, which is not installed: pip install "surefix[report]"'
    assert str(refused.value) == said


def test_a_package_is_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert Package("numpy", "numpy", "NumPy").look() == (sys.modules["numpy"].__version__, None)
    assert Package("nothing_here", "none", "None").look() == (None, "is not installed")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "broken_one.py").write_text("raise OSError('libGL.so.1 is missing')\n")
    broken = Package("broken_one", "broken-one", "Broken").look()
    assert broken == (None, "cannot be loaded (libGL.so.1 is missing)")
    (tmp_path / "other_one.py").write_text("__version__ = '4.2'\n")
    assert Package("other_one", "none-of-this-name", "Other").look() == ("4.2", None)
