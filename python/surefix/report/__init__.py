"""Pages of results, with pictures of ``surefix.plot`` inside: of the demo, and of studies."""

# First, as it says which extra to install if matplotlib is missing.
import surefix.plot  # noqa: F401
from surefix.report.page import Picture, Section, Table, Tile, page

__all__ = ["Picture", "Section", "Table", "Tile", "page"]
