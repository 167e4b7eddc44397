"""The stub agrees with the binding: docstrings, and the options with their defaults."""

import ast
import importlib.util
import inspect
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import surefix
from surefix import _core
from surefix.options import OPTIONS, Options

ROOT = Path(__file__).resolve().parents[3]
STUB = (ROOT / "python" / "surefix" / "_core.pyi").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def stubs() -> ModuleType:
    spec = importlib.util.spec_from_file_location("stubs", ROOT / "packaging" / "stubs.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_stubs_docstrings_are_those_of_the_binding(stubs: ModuleType) -> None:
    """After a change of a docstring: make stubs."""
    known = list(stubs.documented(STUB, _core))
    assert len(known) > 100
    for node, text in known:
        assert ast.get_docstring(node) == text, node.name


def test_docstrings_are_copied_once_into_a_stub_without_them(stubs: ModuleType) -> None:
    bare = "def read_image(path: str) -> int: ...\nclass Sad:\n    def describe(self) -> int: ...\n"
    once = stubs.with_docstrings(bare, _core)
    assert stubs.with_docstrings(once, _core) == once
    module = ast.parse(once)
    function, class_ = module.body
    assert isinstance(function, ast.FunctionDef)
    assert isinstance(class_, ast.ClassDef)
    assert ast.get_docstring(function) == inspect.cleandoc(_core.read_image.__doc__ or "")
    method = class_.body[-1]
    assert isinstance(method, ast.FunctionDef)
    assert (ast.get_docstring(method) or "").startswith("The image's descriptor")


def test_the_table_of_options_has_those_of_the_binding() -> None:
    names = [option.name for option in OPTIONS]
    # `config` holds all of them.
    assert sorted([*names, "config"]) == sorted(Options.__annotations__)
    with pytest.raises(surefix.SurefixValueError) as refused:
        surefix.Matcher(3, nothing=1)  # type: ignore[call-arg]
    expected = str(refused.value).partition("expected one of ")[2].split(", ")
    assert sorted(expected) == sorted(names)


def test_the_tables_defaults_are_those_of_the_binding() -> None:
    """A snapshot is restored only under the options that it was taken under."""
    blob = surefix.Matcher(5).snapshot()
    surefix.Matcher.restore(blob, **{option.name: option.default for option in OPTIONS})
    for option, other in (("sequence_length", 3), ("weight", 0.5), ("tolerance", 2),
                          ("smoothing", 1), ("floor", 0.5), ("speeds", [2.0]),
                          ("gradient", "unhalved")):  # fmt: skip
        with pytest.raises(surefix.SurefixValueError, match=option):
            surefix.Matcher.restore(blob, **{option: other})


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("sequence_length", "2", "a whole number of 0 or more, got '2'"),
        ("weight", "a", "a number, got 'a'"),
        ("gradient", "half", '"halved" or "unhalved", got \'half\''),
        ("gradient", 1, '"halved" or "unhalved", got 1'),
        ("floor", "low", '"running", "global" or a number, got \'low\''),
        ("floor", None, '"running", "global" or a number, got None'),
        ("speeds", 1.0, "a sequence of numbers, in places a query, got 1.0"),
        ("speeds", ["a"], "a sequence of numbers, in places a query, got ['a']"),
    ],
)
def test_an_option_of_another_type_is_refused_by_name(
    option: str, value: object, expected: str
) -> None:
    with pytest.raises(surefix.SurefixValueError) as refused:
        surefix.Matcher(3, **{option: value})  # type: ignore[arg-type]
    assert str(refused.value) == f"option `{option}`: expected {expected}"


def test_options_may_be_numpys_and_any_iterable() -> None:
    options = {
        "sequence_length": np.int64(2), "weight": np.float32(0.5), "floor": np.float64(0.25),
        "gradient": np.str_("unhalved"), "speeds": (speed for speed in np.array([1.0, 0.5])),
    }  # fmt: skip
    blob = surefix.Matcher(5, **options).snapshot()
    same = {"weight": 0.5, "floor": 0.25, "gradient": "unhalved", "speeds": [1, 0.5]}
    assert surefix.Matcher.restore(blob, **same).places == 5
