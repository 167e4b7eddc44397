"""The file of a study, checked: an error names its line."""

import re
import tomllib
from collections.abc import Mapping
from glob import glob
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np

from surefix._core import match_distances
from surefix.baselines import METHODS
from surefix.errors import SurefixError, SurefixValueError, mismatch, refusal
from surefix.judged import Recall
from surefix.motion import Motion
from surefix.study.plan import NONE, ROUTE_NAME, Plan, Table

__all__ = ["FILES", "SAMPLING", "read_plan"]

# Of a route that every length of a sequence fits.
LONGEST = 10_000

TEXT, NUMBER, WHOLE, FLAG = "a string", "a number", "a whole number", "true or false"
KINDS: Mapping[str, tuple[type, ...]] = {
    TEXT: (str,),
    NUMBER: (int, float),
    WHOLE: (int,),
    FLAG: (bool,),
}
SAMPLING = {
    "topic": TEXT, "stride": WHOLE, "every": NUMBER, "metres": NUMBER, "odometry": TEXT,
    "order": TEXT, "strict": FLAG, "crop": FLAG,
}  # fmt: skip
ROUTE = {
    "name": TEXT, "references": TEXT, "queries": TEXT, "truth": TEXT, "positions": TEXT,
    "query_positions": TEXT, "tolerance": NUMBER, "position_gap": NUMBER, **SAMPLING,
}  # fmt: skip
DESCRIPTOR = {
    "name": TEXT, "file": TEXT, "queries": TEXT, "similarity": FLAG, "model": TEXT,
    "weights": TEXT, "output": TEXT,
}  # fmt: skip
# The fields of ``Settings`` and ``Context`` that methods on distances take.
MATCHER = {
    "sequence_length": WHOLE, "weight": NUMBER, "floor": "a name or a number", "tolerance": WHOLE,
    "smoothing": WHOLE, "gradient": TEXT, "speeds": "a list of numbers",
    "motion": "a name or a table",
}  # fmt: skip
BASELINES = {"contrast": WHOLE, "exclude": WHOLE, "top": WHOLE}
SETTINGS = MATCHER | BASELINES
TOP = {"recall": TEXT, "upto": NUMBER, "samples": WHOLE}
# The keys that name files, and those that may name a topic of a bag.
FILES = ("references", "queries", "truth", "positions", "query_positions", "odometry", "file",
         "weights")  # fmt: skip
TOPICS = ("query_positions", "odometry")


def read_plan(path: Path) -> Plan:
    """The study that a TOML file describes.

    Raises
    ------
    SurefixFileError
        If it cannot be read.
    SurefixValueError
        If it is no TOML, or says something that it may not; with the line.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise refusal(path, "cannot read the study", error) from None
    except UnicodeDecodeError as error:
        raise mismatch(path, "a text in UTF-8", f"a byte that is none at {error.start}") from None
    try:
        given = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SurefixValueError(f"{path}: expected TOML: {error}") from None
    return _Reader(path, text).plan(given)


class _Reader:
    """Checks what a file says; its errors name the line."""

    def __init__(self, path: Path, text: str) -> None:
        self.path, self.lines = path, text.splitlines()

    def plan(self, given: dict[str, Any]) -> Plan:
        tables = ("route", "descriptor", "settings", "methods")
        top = {key: value for key, value in given.items() if key not in tables}
        self.check("", 0, top, TOP, more=tables)
        routes = self.tables("route", given, ROUTE)
        descriptors = self.tables("descriptor", given, DESCRIPTOR)
        for at, route in enumerate(routes):
            self._check_route(at, route, descriptors)
        for at, descriptor in enumerate(descriptors):
            self._check_descriptor(at, descriptor, routes)
        for name, tables_ in (("route", routes), ("descriptor", descriptors)):
            for (at, table), route in product(enumerate(tables_), routes):
                self._check_files(name, at, table, route)
        recall = top.get("recall", "correct")
        if recall not in get_args(Recall):
            raise self.wrong("", 0, "recall", f"one of {', '.join(get_args(Recall))}", recall)
        for key, least, most in (("upto", 0.001, 1.0), ("samples", 10, 1_000_000)):
            if key in top and not least <= top[key] <= most:
                raise self.wrong("", 0, key, f"{least} to {most}", top[key])
        settings = self._settings(given.get("settings", {}))
        methods = self._methods(given.get("methods", ["weighted"]), settings)
        return Plan(self.path, routes, descriptors, settings, methods, **top)

    def tables(self, name: str, given: dict[str, Any], known: Mapping[str, str]) -> list[Table]:
        """All ``[[name]]``, with different names."""
        found = given.get(name)
        if not isinstance(found, list) or not found or not isinstance(found[0], dict):
            expected = f"tables [[{name}]], at least one"
            raise self.wrong("", 0, name, expected, "none" if found is None else "another kind")
        tables: list[Table] = []
        for at, each in enumerate(found):
            self.check(name, at, each, known)
            own = each.get("name")
            if not own:
                raise self.wrong(name, at, "name", "a name", "none")
            if own in [other.name for other in tables]:
                raise self.wrong(name, at, "name", "a name each", f"{own!r} twice")
            tables.append(Table(own, each))
        return tables

    def _check_route(self, at: int, route: Table, descriptors: list[Table]) -> None:
        given = route.given
        by_position = "query_positions" in given
        if "truth" in given and (by_position or "positions" in given):
            raise self.wrong("route", at, "truth", "it or positions", "both")
        if "truth" not in given and not by_position:
            raise self.wrong("route", at, "truth", "it, or query_positions", "neither")
        if by_position and "tolerance" not in given:
            expected = "the metres from the truth that are right"
            raise self.wrong("route", at, "tolerance", expected, "none")
        for descriptor in descriptors:
            lacks = "references" not in given and "file" not in descriptor.given
            if lacks:
                expected = f"the images that {descriptor.name!r} describes"
                raise self.wrong("route", at, "references", expected, "none")

    def _check_descriptor(self, at: int, descriptor: Table, routes: list[Table]) -> None:
        given = descriptor.given
        if "file" in given:
            if len(routes) > 1 and ROUTE_NAME not in given["file"]:
                expected = f"{ROUTE_NAME} in it, as there are {len(routes)} routes"
                raise self.wrong("descriptor", at, "file", expected, repr(given["file"]))
        elif "queries" in given:
            raise self.wrong("descriptor", at, "queries", "file too", "none")

    def _check_files(self, name: str, at: int, table: Table, route: Table) -> None:
        for key in FILES:
            file = str(table.given.get(key, "")).replace(ROUTE_NAME, route.name)
            known = (key, file) == ("truth", "identity") or (file.startswith("/") and key in TOPICS)
            if file and not known and not Path(file).exists() and not glob(file):
                raise self.wrong(name, at, key, "a file or a folder", f"{file}, which is not there")

    def _settings(self, given: Any) -> dict[str, list[Any]]:
        if not isinstance(given, dict):
            raise self.wrong("", 0, "settings", "a table [settings]", "another kind")
        found: dict[str, list[Any]] = {}
        for key, value in given.items():
            if key not in SETTINGS:
                raise self.unknown("settings", 0, key, SETTINGS)
            # The speeds are a list themselves.
            several = isinstance(value, list)
            if key == "speeds":
                several = several and bool(value) and isinstance(value[0], list)
            found[key] = list(value) if several else [value]
            if not found[key]:
                raise self.wrong("settings", 0, key, SETTINGS[key], "an empty list")
            for each in found[key]:
                self._check_setting(key, each)
        return found

    def _check_setting(self, key: str, value: Any) -> None:
        """By the type and range of the option itself."""
        expected = SETTINGS[key]
        if expected in KINDS and not _is(value, expected):
            raise self.wrong("settings", 0, key, expected, _said(value))
        if key in BASELINES:
            if value < 0:
                raise self.wrong("settings", 0, key, "0 or more", value)
            return
        if value == NONE:
            return
        try:
            given: dict[str, Any] = {key: Motion(**value) if isinstance(value, dict) else value}
            match_distances(np.zeros((LONGEST, 1), np.float32), **given)
        except TypeError:
            options = "options of surefix.Motion" if isinstance(value, dict) else expected
            raise self.wrong("settings", 0, key, options, _said(value)) from None
        except SurefixError as error:
            said = str(error).removeprefix(f"option `{key}`: ")
            raise SurefixValueError(f"{self.where('settings', 0, key)}: {said}") from None

    def _methods(self, given: Any, settings: dict[str, list[Any]]) -> list[str]:
        if not isinstance(given, list) or not given:
            raise self.wrong("", 0, "methods", "a list of methods", _said(given))
        for name in given:
            if not isinstance(name, str) or name not in METHODS:
                raise self.wrong("", 0, "methods", f"some of {', '.join(METHODS)}", _said(name))
            needs = METHODS[name].needs
            if needs not in (None, "truth", "motion"):
                expected = "methods that need the distances alone"
                raise self.wrong("", 0, "methods", expected, repr(name))
            moves = [each for each in settings.get("motion", []) if each != NONE]
            if needs == "motion" and not moves:
                expected = f"a motion for the method {name!r}"
                raise self.wrong("settings", 0, "motion", expected, "none")
        return list(dict.fromkeys(given))

    def check(
        self, table: str, at: int, given: dict[str, Any], known: Mapping[str, str], more: Any = ()
    ) -> None:
        """The keys, and the types of their values."""
        for key, value in given.items():
            if key not in known:
                raise self.unknown(table, at, key, [*more, *known])
            if not _is(value, known[key]):
                raise self.wrong(table, at, key, known[key], _said(value))

    def unknown(self, table: str, at: int, key: str, known: Any) -> SurefixValueError:
        return mismatch(self.where(table, at, key), f"one of {', '.join(known)}", repr(key))

    def wrong(
        self, table: str, at: int, key: str, expected: object, got: object
    ) -> SurefixValueError:
        return mismatch(self.where(table, at, key), expected, got)

    def where(self, table: str, at: int, key: str) -> str:
        """The file, the line and the key, for an error; a key that there is not is at its table."""
        line = self._line(table, at, key)
        name = f"{table}.{key}" if table else key
        return f"{self.path}, line {line}, {name}" if line else f"{self.path}, {name}"

    def _line(self, table: str, at: int, key: str) -> int | None:
        inside, seen, begins = not table, -1, None
        for number, line in enumerate(self.lines, 1):
            if heading := re.match(r"\s*\[+\s*([\w.\"-]+)\s*\]+", line):
                name = heading[1].strip('"')
                seen += name == table
                inside = name == table and (seen == at)
                begins = number if inside else begins
                # A table of a wrong kind or place.
                if not table and name == key:
                    return number
            elif inside and re.match(rf"\s*\"?{re.escape(key)}\"?\s*[=.]", line):
                return number
        return begins


def _is(value: Any, kind: str) -> bool:
    if isinstance(value, bool):
        return kind == FLAG
    return isinstance(value, KINDS[kind])


def _said(value: Any) -> str:
    return repr(value)
