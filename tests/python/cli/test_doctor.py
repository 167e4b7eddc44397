"""``surefix doctor``: what it says is so, and a core that answers wrong is a failure."""

import json
import sys
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import surefix
from commands import surefix_
from surefix._core import instruction_set
from surefix._extra import EXTRAS
from surefix.descriptors import HUB_MODELS

# In the package, the function is found by this name.
doctor = import_module("surefix.cli.doctor")


@pytest.fixture(autouse=True)
def _without(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few packages, as some take seconds to import."""
    few = {name: EXTRAS[name] for name in ("plot", "files", "dataframe")}
    monkeypatch.setattr(doctor, "EXTRAS", few)
    monkeypatch.setitem(sys.modules, "pandas", None)


def test_the_facts_are_those_of_this_machine() -> None:
    facts: dict[str, Any] = json.loads(surefix_("doctor", "--json").stdout)
    assert facts["version"] == surefix.__version__
    assert facts["check"] is None
    assert facts["executable"] == sys.executable
    assert facts["instruction_set"] == instruction_set()
    assert 1 <= facts["cores_available"] <= facts["cores"]
    assert facts["models"] == [*HUB_MODELS]
    # The tests have no display.
    assert sys.platform != "linux" or (facts["display"], bool(facts["viewer"])) == (None, True)
    assert facts["extras"]["dataframe"] == {
        "for": EXTRAS["dataframe"].purpose,
        "packages": {"pandas": None},
        "problems": ["pandas is not installed"],
        "install": 'pip install "surefix[dataframe]"',
    }
    pillow = pytest.importorskip("PIL")
    plot = facts["extras"]["plot"]
    assert plot["packages"]["Pillow"] == pillow.__version__


def test_the_table_says_how_to_get_what_is_missing() -> None:
    done = surefix_("doctor")
    lines = [line.split() for line in done.stdout.splitlines() if line.strip()]
    said = {words[0]: " ".join(words[1:]) for words in lines}
    assert said["surefix"] == surefix.__version__
    assert said["self-check"] == "right"
    assert said["[dataframe]"] == 'not installed: pip install "surefix[dataframe]" (data frames)'
    assert all(name in said["models"] for name in HUB_MODELS)
    assert done.stderr == ""
    assert all(line == line.rstrip() for line in done.stdout.splitlines())


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"place": np.zeros(16, int)}, "place: expected 2 to 15 in order, got [0, 0,"),
        ({"single_place": np.ones(16, int)}, "single_place: expected 2 to 15 in order, got"),
        ({"trusted": np.zeros(16, bool)}, "trusted: expected all, got 0 of 14"),
    ],
)
def test_a_run_that_is_wrong_is_a_failure(
    wrong: dict[str, Any], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Wrong:
        place = single_place = np.arange(16)
        trusted = np.ones(16, bool)

    def run(*_: object, **__: object) -> Any:
        made = Wrong()
        for name, value in wrong.items():
            setattr(made, name, value)
        return made

    monkeypatch.setattr(doctor, "match", run)
    done = surefix_("doctor", code=1)
    assert done.stderr.startswith(f"surefix: self-check: {words}")
    assert done.stderr.count("\n") == 1
    # What is installed is said all the same.
    assert "[dataframe]" in done.stdout
    assert json.loads(surefix_("doctor", "--json", code=1).stdout)["check"].startswith(words)


def test_distances_that_are_wrong_are_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    class Wrong:
        def __init__(self, route: surefix.Map) -> None:
            self.descriptors, self.route = route.descriptors, route

        def distances(self, row: np.ndarray) -> np.ndarray:
            return self.route.distances(row) * np.float32(1.001)

    class Maps:
        @staticmethod
        def from_images(*given: Any, **options: Any) -> Wrong:
            return Wrong(surefix.Map.from_images(*given, **options))

    monkeypatch.setattr(doctor, "Map", Maps)
    done = surefix_("doctor", code=1)
    assert "self-check: expected the distances that NumPy computes, got others" in done.stderr
