"""Artifacts: the controller as one canonical, hashed document that the run-time side loads."""

from quasilpv.artifact.schema import Artifact
from quasilpv.artifact.store import Difference, diff, read_artifact, summary, write_artifact
from quasilpv.documents.programs import Program, evaluate

__all__ = [
    "Artifact",
    "Difference",
    "Program",
    "diff",
    "evaluate",
    "read_artifact",
    "summary",
    "write_artifact",
]
