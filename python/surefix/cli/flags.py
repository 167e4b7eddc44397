"""Flags of the command line: help from docstrings, and the method's options from their table."""

import inspect
import re
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

import typer
from typer.models import OptionInfo

from surefix import Settings, SurefixValueError, set_max_pixels
from surefix._ray import tasks
from surefix.cli.inputs import Place, one_place
from surefix.options import OPTIONS, Option

Command = Callable[..., None]
# The word for an option that is None.
NONE = "none"
# The headings in the help of options that several commands have, unless a command has its own.
FRAMES, SEGMENTS, TRUTH, SELDOM = "Frames", "Segments", "The truth", "Seldom needed"
HEADINGS = {
    name: heading
    for heading, names in {
        FRAMES: "topic stride every metres odometry spacing places_per_metre gap order strict crop",
        SEGMENTS: "breaks no_breaks closed not_closed new_segment",
        TRUTH: "position_gap",
        SELDOM: "key patch output mean std batch levels mixed_sizes",
    }.items()
    for name in names.split()
}

RAY = inspect.Parameter(
    "ray",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[
        bool,
        typer.Option(
            "--ray",
            help="Let Ray do the work: on this machine, or on the cluster of RAY_ADDRESS.",
        ),
    ],
)
FRAME_OPTIONS = frozenset({"topic", "order", "strict", "mixed_sizes", "data"})
# Of every command that reads images.
MAX_PIXELS = inspect.Parameter(
    "max_pixels",
    inspect.Parameter.KEYWORD_ONLY,
    default=None,
    annotation=Annotated[
        int | None,
        typer.Option(
            "--max-pixels",
            min=1,
            metavar="N",
            help="The most pixels that are decoded at once; 100,000,000 by default.",
            rich_help_panel=SELDOM,
        ),
    ],
)


def documented(command: Command) -> Command:
    """Gives a command's parameters their help: ``name: help`` in its docstring, after the summary.

    A bool is a flag without an opposite; a text beside a type is the heading that it stands under,
    else that of ``HEADINGS``. Options that are seldom needed come last.
    A ``Place`` may be given as all the files that a pattern matches.
    """
    text = inspect.cleandoc(command.__doc__ or "")
    summary, _, rest = text.partition("\n\nParameters\n----------\n")
    entries = (entry.partition(": ") for entry in re.split(r"\n(?=\w+: )", rest))
    helps = {name: " ".join(text.split()) for name, _, text in entries}
    parameters: list[inspect.Parameter] = []
    places: list[str] = []
    signature = inspect.signature(command, eval_str=True)
    for parameter in signature.parameters.values():
        if parameter.name in helps:
            kind, info = parameter.annotation, None
            if kind in (Place, Place | None):
                places.append(parameter.name)
                kind, info = list[str] if kind is Place else list[str] | None, typer.Argument()
            if get_origin(kind) is Annotated:
                kind, info = get_args(kind)
            if parameter.default is parameter.empty and not isinstance(info, OptionInfo):
                info = typer.Argument()
            elif info is None or isinstance(info, str):
                names = [f"--{parameter.name.replace('_', '-')}"] if kind is bool else []
                info = typer.Option(*names, rich_help_panel=info)
            info.help = helps[parameter.name]
            parameter = parameter.replace(annotation=Annotated[kind, info])
        parameters.append(_headed(parameter))
    if any(parameter.name in FRAME_OPTIONS for parameter in parameters):
        parameters.append(MAX_PIXELS)
    # A heading stands in the help at its first option.
    seldom = [each for each in parameters if _heading(each) == SELDOM]
    others = [each for each in parameters if each not in seldom]
    last = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in seldom]

    @wraps(command)
    def run(*, max_pixels: int | None = None, **given: Any) -> None:
        if max_pixels is not None:
            set_max_pixels(max_pixels)
        command(**(given | {name: one_place(given[name]) for name in places}))

    # A line break of the source is none of the help's.
    run.__doc__ = "\n\n".join(" ".join(each.split()) for each in summary.split("\n\n"))
    run.__signature__ = signature.replace(parameters=others + last)  # type: ignore[attr-defined]
    return run


def with_ray(command: Command) -> Command:
    """Gives a command ``--ray``: Ray does the jobs that it has."""

    @wraps(command)
    def run(*, ray: bool, **given: Any) -> None:
        with tasks(ray):
            command(**given)

    signature = inspect.signature(command, eval_str=True)
    parameters = [*signature.parameters.values(), RAY]
    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return run


def _headed(parameter: inspect.Parameter) -> inspect.Parameter:
    """The parameter under its heading, if it is an option that has none."""
    for info in getattr(parameter.annotation, "__metadata__", ()):
        if isinstance(info, OptionInfo) and info.rich_help_panel is None:
            info.rich_help_panel = HEADINGS.get(parameter.name)
    return parameter


def _heading(parameter: inspect.Parameter) -> str | None:
    """The heading of an option, if it has one."""
    infos = getattr(parameter.annotation, "__metadata__", ())
    return next((info.rich_help_panel for info in infos if isinstance(info, OptionInfo)), None)


def with_options(
    floor: str = "running", motion: str | None = None, names: dict[str, str] | None = None
) -> Callable[[Command], Command]:
    """Gives a command a flag for each option; its parameter ``options`` gets those that are given.

    ``floor`` is the default of that option in the help, ``motion`` is what that option is without
    its flag (and without the command's ``config``), and ``names`` are other names for flags; the
    option's own goes on to work, unseen, if the command has no parameter of that name.
    """
    usual = {"motion": motion} if motion else {}

    def decorate(command: Command) -> Command:
        flags = {option.name: (names or {}).get(option.name, option.name) for option in OPTIONS}

        own = inspect.signature(command).parameters
        unseen = [name for name in names or () if name not in own]

        @wraps(command)
        def with_flags(**given: Any) -> None:
            other = {name: given.pop(name) for name in unseen}
            values = [(option, given.pop(flags[option.name])) for option in OPTIONS]
            values = [(o, other.get(o.name) if value is None else value) for o, value in values]
            options = {o.name: _value(o, value) for o, value in values if value is not None}
            command(**given, options=options if given.get("config") else usual | options)

        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(command, eval_str=True).parameters.values():
            if parameter.name != "options":
                parameters.append(parameter)
                continue
            for option in OPTIONS:
                default = ({"floor": floor} | usual).get(option.name, option.default)
                parameters.append(_parameter(option, flags[option.name], default))
                if option.name in unseen:
                    parameters.append(_parameter(option, option.name, default, hidden=True))
        with_flags.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        return with_flags

    return decorate


def settings_of(config: Path | None, options: dict[str, Any]) -> Settings:
    """The settings of the file, if there is one, and the options that are given."""
    try:
        known = None if config is None else Settings.open(config)
    except SurefixValueError as error:
        raise typer.BadParameter(f"--config: {error}") from None
    try:
        given = Settings(config=known, **options)
    except SurefixValueError as error:
        raise typer.BadParameter(str(error)) from None
    return given


def in_flags(message: str, context: Any) -> str:
    """The message with the flag of the command in place of an option of Python's."""
    known = {} if context is None else {each.name: each for each in context.command.params}

    def flag(found: re.Match[str]) -> str:
        # Of the two tolerances of such a command, that of the method.
        own = found[1] == "tolerance" and "agreement" in known
        name = "agreement" if own else found[1]
        return f"--{name.replace('_', '-')}" if name in known else found[0]

    return re.sub(r"option `(\w+)`", flag, message)


def _parameter(option: Option, name: str, default: Any, hidden: bool = False) -> inspect.Parameter:
    """The option as a parameter that typer reads."""
    kind: Any = option.type
    if option.type is str:
        kind = Literal[*option.choices, NONE] if option.default is None else Literal[option.choices]
        default = default or NONE
    elif option.type is list:
        # As it is typed: numbers with commas.
        kind, default = str, ",".join(f"{each:g}" for each in default)
    elif option.choices:
        kind = str
    names = [f"--{name.replace('_', '-')}", *([f"-{option.short}"] if option.short else [])]
    help_ = option.help if option.type is str else f"{option.help[:-1]}: {option.range}."
    # An empty list is as the help says.
    usual = "" if default == "" else f"; {default} by default"
    panel = SELDOM if option.seldom else None
    text = f"{help_[:-1]}{usual}."
    flag = typer.Option(*names, help=text, hidden=hidden, rich_help_panel=panel)
    only, annotation = inspect.Parameter.KEYWORD_ONLY, Annotated[kind | None, flag]
    return inspect.Parameter(name, only, default=None, annotation=annotation)


def _value(option: Option, given: Any) -> Any:
    """The flag's value, of the option's type."""
    flag = f"--{option.name}"
    if option.type is list:
        try:
            return [float(each) for each in given.split(",")]
        except ValueError:
            expected = "numbers with commas, such as 0.9,1,1.1"
            raise typer.BadParameter(f"{flag}: expected {expected}, got {given!r}") from None
    if option.type is float and option.choices and given not in option.choices:
        try:
            return float(given)
        except ValueError:
            raise typer.BadParameter(f"{flag}: expected {option.range}, got {given!r}") from None
    return None if option.default is None and given == NONE else given
