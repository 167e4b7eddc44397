"""Pages of results: interactive ones of runs and of studies, with pictures of ``surefix.plot``."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

# First, as it says which extra to install if matplotlib is missing.
import surefix.plot  # noqa: F401
from surefix.report.album import Album
from surefix.report.page import Picture, Section, Table, Tile, page

if TYPE_CHECKING:
    from surefix.report.eval import write_report
    from surefix.report.run import write_run

__all__ = ["Album", "Picture", "Section", "Table", "Tile", "page", "write_report", "write_run"]

# These take Bokeh; the others do not.
LATER = {"write_report": "surefix.report.eval", "write_run": "surefix.report.run"}


def __getattr__(name: str) -> Any:
    if name not in LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(LATER[name]), name)
