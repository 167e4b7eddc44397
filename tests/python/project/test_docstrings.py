"""Every public name has a docstring, and every example in one runs and gives its output."""

import doctest
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import surefix
import surefix.descriptors
import surefix.frames
import surefix.simulate


def documented() -> Iterator[tuple[str, Any]]:
    for module in (surefix, surefix.simulate, surefix.frames):
        for name in module.__all__:
            if name.startswith("_"):
                continue
            thing = getattr(module, name)
            yield f"{module.__name__}.{name}", thing
            if inspect.isclass(thing):
                for member, value in vars(thing).items():
                    if not member.startswith("_"):
                        yield f"{module.__name__}.{name}.{member}", value


# In one order: a class of the binding has its members in any.
ALL = dict(sorted(documented()))
# Fields whose names say it all, described together in their class's docstring.
PLAIN = {"surefix.Matches", "surefix.Fix", "surefix.Single", "surefix.Peak", "surefix.Sequence"}
PLAIN |= {"surefix.frames.Frame", "surefix.frames.Shot"}


@pytest.mark.parametrize("name", ALL)
def test_it_has_a_docstring(name: str) -> None:
    described_by_class = name.rpartition(".")[0] in PLAIN and name.rpartition(".")[2]
    text = inspect.getdoc(ALL[name]) or ""
    if described_by_class:
        text = inspect.getdoc(ALL[name.rpartition(".")[0]]) or ""
        assert described_by_class in text
    assert len(text) > 10


EXAMPLES = [name for name, thing in ALL.items() if ">>>" in (getattr(thing, "__doc__", None) or "")]


@pytest.mark.parametrize("name", EXAMPLES)
def test_its_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = inspect.getdoc(ALL[name])
    assert text is not None
    test = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    said: list[str] = []
    doctest.DocTestRunner().run(test, out=said.append)
    assert not said, "".join(said)


def test_there_are_examples_where_users_look_first() -> None:
    first = {"Map", "Matcher", "Localizer", "Sad", "Fix", "match", "match_distances", "evaluate"}
    assert {f"surefix.{name}" for name in first} <= set(EXAMPLES)
