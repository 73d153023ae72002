"""Questions about conditions: one point, a boundary, a map, a count. Every yes is proved in exact arithmetic."""

from quasilpv.studies.boundary import Boundary, find_boundary
from quasilpv.studies.complexity import Complexity, count
from quasilpv.studies.question import Answer, Question, Sweep, Verdict

__all__ = ["Answer", "Boundary", "Complexity", "Question", "Sweep", "Verdict", "count", "find_boundary"]
