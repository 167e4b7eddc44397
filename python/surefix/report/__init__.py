"""Pages of results: interactive ones of runs and of studies, with pictures of ``surefix.plot``."""

# First, as it says which extra to install if matplotlib is missing.
import surefix.plot  # noqa: F401

try:
    import bokeh as _bokeh  # noqa: F401
except ModuleNotFoundError as error:
    if error.name != "bokeh":
        raise
    message = "surefix.report takes Bokeh, which is not installed: pip install 'surefix[report]'"
    raise ModuleNotFoundError(message, name=error.name) from None

from surefix.report.album import Album
from surefix.report.eval import write_report
from surefix.report.page import Picture, Section, Table, Tile, page
from surefix.report.run import write_run

__all__ = ["Album", "Picture", "Section", "Table", "Tile", "page", "write_report", "write_run"]
