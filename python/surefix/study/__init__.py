"""Methods compared on distances whose truth is known: the demo, ``surefix eval`` and ``surefix
reproduce`` are made of studies.
"""

from surefix.study.confidence import (
    Reliability,
    frames_to_notice,
    frames_to_relocalise,
    reliability,
    roc_area,
)
from surefix.study.scenarios import SCENARIOS, Drive, Scenario, scenario
from surefix.study.study import BASELINE, KS, UPTO, Estimate, Recall, Result, Study, compare
from surefix.study.verdict import verdict

__all__ = [
    "BASELINE",
    "KS",
    "SCENARIOS",
    "UPTO",
    "Drive",
    "Estimate",
    "Recall",
    "Reliability",
    "Result",
    "Scenario",
    "Study",
    "compare",
    "frames_to_notice",
    "frames_to_relocalise",
    "reliability",
    "roc_area",
    "scenario",
    "verdict",
]
