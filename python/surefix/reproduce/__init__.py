"""The paper made again: its table and figures, on whatever of its data is there, and on a generated
route.

Carson, Ford and Milford, *Unsupervised Quality Prediction for Improved Single-Frame and Weighted
Sequential Visual Place Recognition*, ICRA 2023 (arXiv 2307.01464). A file for each comparison.
"""

# First of all: it says which extra to install where matplotlib or Pillow is missing.
from surefix import plot as _plot  # noqa: F401
from surefix.reproduce.case import Case, Settings
from surefix.reproduce.comparison import Comparison
from surefix.reproduce.found import Found, check_pairs, find_datasets, load_cases, read_pairs
from surefix.reproduce.images import generated_cases
from surefix.reproduce.matrices import matrix_case
from surefix.reproduce.paper import PaperRow, read_paper
from surefix.reproduce.report import comparisons, write_report

__all__ = [
    "Case",
    "Comparison",
    "Found",
    "PaperRow",
    "Settings",
    "check_pairs",
    "comparisons",
    "find_datasets",
    "generated_cases",
    "load_cases",
    "matrix_case",
    "read_pairs",
    "read_paper",
    "write_report",
]
