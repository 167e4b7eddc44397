"""Methods compared on distances whose truth is known: the demo, ``surefix eval`` and ``surefix
reproduce`` are made of studies.
"""

from surefix.study.study import BASELINE, KS, UPTO, Estimate, Recall, Result, Study, compare
from surefix.study.verdict import verdict

__all__ = ["BASELINE", "KS", "UPTO", "Estimate", "Recall", "Result", "Study", "compare", "verdict"]
