"""Designs kept on disk under the hash of everything they depend on, so that no design is made twice."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import quasilpv
from quasilpv.artifact import Artifact, read_artifact, write_artifact
from quasilpv.artifact.store import JSON_NAME
from quasilpv.documents.canonical import document_hash
from quasilpv.errors import InputError
from quasilpv.files import forget_input
from quasilpv.release import checked_artifact, design_inputs
from quasilpv.synthesis import Specification, synthesise, without_compensation
from quasilpv.synthesis.progress import Progress, no_progress
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.registry import robot

DEFAULT_CACHE = Path("out/cache")

# The rooms whose code decides what a design is and whether it is released; a change in any of them makes every kept
# design stale.
_DESIGN_ROOMS = (
    "systems",
    "polytopes",
    "loops",
    "lmi",
    "conditions",
    "synthesis",
    "certificate",
    "artifact",
    "files",
    "defaults.py",
    "release.py",
)

_designs: dict[tuple[str, str, Specification], TrackingDesign] = {}
"""Of this process. The folder holds artifacts, and those with and without compensation are two, each with its own proof
of the same gains."""


def kept_design(
    robot_id: str,
    controller: str,
    specification: Specification,
    *,
    disturbance_compensation: bool = True,
    folder: Path = DEFAULT_CACHE,
    progress: Progress = no_progress,
) -> Artifact:
    """The artifact of a design, from the cache if the same design was made before.

    Args:
        robot_id: name in the registry of robots.
        controller: one of `quasilpv.synthesis.CONTROLLERS`.
        specification: what is asked for.
        disturbance_compensation: see `without_compensation`; the gains are searched for once for both.
        folder: the cache; each design is a folder of it, named by the hash of its inputs and of the design code.
        progress: called with (points done, points in all) while a design is made.

    Raises:
        InputError: unknown robot or controller, or the cache cannot be written.
        InfeasibleError: no design meets the specification.
        ClaimError: the design fails its certificate or its robust gate.
    """
    inputs = {
        "controller": controller,
        "specification": specification.to_document(),
        "disturbance_compensation": disturbance_compensation,
        "code": _code_digest(),
    }
    place = folder / document_hash(design_inputs(robot(robot_id), inputs))[:32]
    try:
        return read_artifact(place / JSON_NAME)
    except InputError:  # not there, or damaged: made again
        forget_input(place / JSON_NAME)
        design = _designed(robot_id, controller, specification, progress)
        made = checked_artifact(design if disturbance_compensation else without_compensation(design))
        write_artifact(place, made)
        return made


def _designed(robot_id: str, controller: str, specification: Specification, progress: Progress) -> TrackingDesign:
    asked = robot_id, controller, specification
    if asked not in _designs:
        _designs[asked] = synthesise(robot(robot_id), controller, specification, progress=progress)
    return _designs[asked]


@cache
def _code_digest() -> str:
    """SHA-256 over the sources of the design rooms, in a fixed order."""
    root = Path(quasilpv.__file__).parent
    digest = hashlib.sha256()
    for room in _DESIGN_ROOMS:
        place = root / room
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(f"{path.relative_to(root)}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()
