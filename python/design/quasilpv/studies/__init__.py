"""Questions about conditions: one point, a boundary, a map, a count. Every yes is proved in exact arithmetic."""

from quasilpv.studies.answer import Answer, Evidence, Verdict
from quasilpv.studies.answering import answered
from quasilpv.studies.boundary import Boundary, find_boundary
from quasilpv.studies.complexity import Complexity, count
from quasilpv.studies.question import Question
from quasilpv.studies.sweep import Sweep

__all__ = [
    "Answer",
    "Boundary",
    "Complexity",
    "Evidence",
    "Question",
    "Sweep",
    "Verdict",
    "answered",
    "count",
    "find_boundary",
]
