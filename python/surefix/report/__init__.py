"""Pages of results, with pictures of ``surefix.plot`` inside: the drive of the demo, and the
comparison of methods.
"""

# First, for what it says where matplotlib is missing.
import surefix.plot  # noqa: F401
from surefix.report.page import Picture, Section, Table, Tile, page

__all__ = ["Picture", "Section", "Table", "Tile", "page"]
