"""The help: commands and options in the order of need, in 80 columns; and completion in bash."""

import os
import re
import shutil
import subprocess
import sys

import pytest

from commands import surefix_
from surefix.cli import PANELS, app
from surefix.cli.flags import SELDOM

ORDER = [name for names in PANELS.values() for name in names]


def panels(*command: str) -> dict[str, str]:
    """The text of each panel of a command's help, by its heading."""
    text = surefix_(*command, "--help", COLUMNS="80").stdout
    parts = re.split(r"╭─ (.*?) ─+╮\n", text)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def named(panel: str) -> list[str]:
    """What the rows of a panel begin with."""
    return re.findall(r"^│ +([\w-]+)", re.sub(r"^│ {6,}.*$", "", panel, flags=re.M), flags=re.M)


def commands() -> list[tuple[str, ...]]:
    import typer.main

    program = typer.main.get_command(app)
    found: list[tuple[str, ...]] = [()]
    for name, command in program.commands.items():  # type: ignore[attr-defined]
        found.append((name,))
        found += [(name, each) for each in getattr(command, "commands", {})]
    return found


def test_the_commands_come_in_the_order_in_which_one_needs_them() -> None:
    shown = panels()
    found = {heading: named(shown[heading]) for heading in PANELS}
    for heading, names in found.items():
        assert names == [each for each in PANELS[heading] if each in names]
    listed = [name for names in found.values() for name in names]
    assert listed[:3] == ["demo", "map", "run"]
    assert [name for (name, *below) in commands()[1:] if not below] == listed
    assert {"eval", "align", "audit", "tune", "loops", "reproduce", "bench", "doctor"} < {*listed}
    # One that is added belongs to a panel.
    assert "Commands" not in shown


@pytest.mark.parametrize("command", commands(), ids=" ".join)
def test_help_fits_80_columns_and_a_pipe(command: tuple[str, ...]) -> None:
    text = surefix_(*command, "--help", COLUMNS="80").stdout
    assert max(map(len, text.splitlines())) <= 80
    assert "Example" in text or len(command) < 2
    # Words that are cut have such an end.
    if command:
        assert "…" not in text


@pytest.mark.parametrize("command", ["run", "eval"])
def test_what_is_seldom_needed_comes_last(command: str) -> None:
    shown = panels(command)
    assert [*shown][:2] == ["Arguments", "Options"]
    assert [*shown][-1] == SELDOM
    last, first = named(shown[SELDOM]), named(shown["Options"])
    assert {"--gradient", "--floor", "--smoothing", "--speeds"} <= {*last}
    assert first[0] == "--out"
    assert {"--motion", "--sequence-length", "--weight", "--agreement"} <= {*first}
    assert "factor 1/2 of the paper" in " ".join(shown[SELDOM].replace("│", " ").split())
    assert "--odometry" in named(shown["Frames"])
    if command == "run":
        assert {"--screen", "--newest"} <= {*last}
    else:
        assert named(shown["The truth"])[0] == "--truth"


def test_no_arguments_are_answered_by_the_help() -> None:
    for command in ((), ("map",)):
        done = surefix_(*command, code=2)
        assert "Usage: surefix" in done.stdout + done.stderr
    assert "Missing argument 'route'" in surefix_("run", code=2).stderr
    assert "No such command 'runn'" in surefix_("runn", code=2).stderr
    assert "--motion" in surefix_("run", "a", "b", "--moton", "any", code=2).stderr


def test_an_option_out_of_range_is_named_as_it_is_typed(tmp_path: object) -> None:
    given = "D.npy", "--truth", "identity"
    for flag, value in (("--sequence-length", 0), ("--agreement", -1), ("--speeds", "-1")):
        said = surefix_("eval", *given, flag, value, code=None)
        assert said.returncode in (1, 2)
        assert "option `" not in said.stderr


# As bash calls the function, with the words of the line.
COMPLETING = """
eval "$(surefix --show-completion bash)"
complete -p surefix
while IFS= read -r line; do
  COMP_WORDS=($line); [ "${line% }" = "$line" ] || COMP_WORDS+=("")
  COMP_CWORD=$(( ${#COMP_WORDS[@]} - 1 ))
  COMPREPLY=(); _surefix_completion surefix
  echo "$line-> ${COMPREPLY[*]}"
done
"""
LINES = {
    "surefix ev": ["eval"],
    "surefix map ": ["build", "append", "info", "join", "cut", "thin", "traverse"],
    "surefix run --mot": ["--motion"],
    "surefix run --motion ": ["steady", "free", "any", "none"],
    # Bash completes names of files.
    "surefix run ma": [],
    "surefix run a b --out ma": [],
}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_commands_options_and_files(tmp_path: object) -> None:
    folder = str(tmp_path)
    with open(f"{folder}/surefix", "w", encoding="utf-8") as file:
        code = "import sys; sys.argv[0] = 'surefix'; from surefix.cli import main; main()"
        file.write(f'#!/bin/sh\nexec "{sys.executable}" -c "{code}" "$@"\n')
    os.chmod(f"{folder}/surefix", 0o755)
    environment = os.environ | {"PATH": f"{folder}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "--norc", "-c", COMPLETING],
        input="\n".join(LINES) + "\n",
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    first, *answers = done.stdout.splitlines()
    assert first == "complete -o default -F _surefix_completion surefix"
    for (line, expected), said in zip(LINES.items(), answers, strict=True):
        assert said.split("-> ")[1].split() == expected, line
