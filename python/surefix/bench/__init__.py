"""How fast it is here, beside the rivals that are installed: ``surefix bench``."""

from surefix.bench.line import Contender, Line, Reach, Result, Row, Settings, Skipped
from surefix.bench.rivals import Rivals
from surefix.bench.run import Group, measure, run

__all__ = [
    "Contender",
    "Group",
    "Line",
    "Reach",
    "Result",
    "Rivals",
    "Row",
    "Settings",
    "Skipped",
    "measure",
    "run",
]
