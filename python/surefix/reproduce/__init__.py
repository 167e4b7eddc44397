"""The paper made again: its table and figures, on any of its data that is there, or on a generated
route.

Carson, Ford and Milford, *Unsupervised Quality Prediction for Improved Single-Frame and Weighted
Sequential Visual Place Recognition*, ICRA 2023 (arXiv 2307.01464). A module for each exhibit.
"""

# First, as it says which extra to install if matplotlib or Pillow is missing.
from surefix import plot as _plot  # noqa: F401
from surefix.reproduce.case import Case, Settings, generated_cases, matrix_case
from surefix.reproduce.found import check_pairs, find_datasets, load_cases, read_pairs
from surefix.reproduce.paper import read_paper
from surefix.reproduce.report import exhibits, write_report

__all__ = [
    "Case",
    "Settings",
    "check_pairs",
    "exhibits",
    "find_datasets",
    "generated_cases",
    "load_cases",
    "matrix_case",
    "read_pairs",
    "read_paper",
    "write_report",
]
