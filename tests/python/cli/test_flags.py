"""The flags of the method's options: all in the table's order, and only those given are passed."""

from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from commands import surefix_
from surefix.cli.flags import with_options
from surefix.options import OPTIONS


def given(*arguments: str) -> dict[str, Any]:
    """The options that a command gets."""
    got: dict[str, Any] = {}

    @with_options(names={"tolerance": "agreement"})
    def command(place: str, *, options: dict[str, Any], last: int = 0) -> None:
        got.update(options)

    app = typer.Typer()
    app.command()(command)
    done = CliRunner().invoke(app, ["place", *arguments])
    assert done.exit_code == 0, done.output
    return got


def test_options_that_are_not_given_are_left_to_the_method() -> None:
    assert given() == {}
    assert given("-L", "3", "--floor", "global") == {"sequence_length": 3, "floor": "global"}


def test_every_option_comes_in_its_own_type() -> None:
    flags = ["-L", "3", "-w", "0.5", "--agreement", "2", "--smoothing", "1", "--floor", "0.25"]
    assert given(*flags, "--speeds", "0.5,1", "--gradient", "unhalved", "--last", "1") == {
        "sequence_length": 3, "weight": 0.5, "tolerance": 2, "smoothing": 1, "floor": 0.25,
        "speeds": [0.5, 1.0], "gradient": "unhalved",
    }  # fmt: skip


def test_one_name_has_one_meaning_and_the_old_one_goes_on_to_work() -> None:
    text = surefix_("run", "--help").stdout
    assert "--agreement " in text
    assert "--tolerance" not in text
    got: list[dict[str, Any]] = []

    @with_options(names={"tolerance": "agreement"})
    def command(*, options: dict[str, Any]) -> None:
        got.append(options)

    app = typer.Typer()
    app.command()(command)
    for flag in ("--agreement", "--tolerance"):
        app([flag, "2"], standalone_mode=False)
    assert got == [{"tolerance": 2}, {"tolerance": 2}]


@pytest.mark.parametrize("command", ["run", "eval"])
def test_the_help_has_a_flag_for_each_in_the_tables_order(command: str) -> None:
    text = surefix_(command, "--help").stdout
    names = {"tolerance": "agreement"}
    flags = [f"--{names.get(each.name, each.name).replace('_', '-')} " for each in OPTIONS]
    places = [text.index(flag) for flag in flags]
    assert places == sorted(places)
    assert "; by default" not in " ".join(text.split())
