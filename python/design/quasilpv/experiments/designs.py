"""Designs kept on disk under the hash of everything they depend on, so that no design is made twice."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache
from pathlib import Path

import quasilpv
from quasilpv.artifact import Artifact, read_artifact, write_artifact
from quasilpv.artifact.store import JSON_NAME
from quasilpv.documents.canonical import document_hash
from quasilpv.errors import InputError
from quasilpv.files import forget_input
from quasilpv.progress import Progress, no_progress
from quasilpv.release import checked_artifact, design_inputs
from quasilpv.synthesis import DesignRequest, synthesise, without_compensation
from quasilpv.synthesis.tracking_design import TrackingDesign

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
    "documents",
    "files",
    "arrays.py",
    "defaults.py",
    "progress.py",
    "release.py",
)

_designs: dict[DesignRequest, TrackingDesign] = {}
"""Of this process. The folder holds artifacts, and those with and without compensation are two, each with its own proof
of the same gains."""


def kept_design(
    request: DesignRequest,
    *,
    folder: Path = DEFAULT_CACHE,
    progress: Progress = no_progress,
) -> Artifact:
    """The artifact of a design, from the cache if the same design was made before.

    Args:
        request: what is asked for; the gains are searched for once, with compensation and without.
        folder: the cache; each design is a folder of it, named by the hash of its inputs and of the design code.
        progress: called with (points done, points in all) while a design is made.

    Raises:
        InputError: unknown controller, or the cache cannot be written.
        InfeasibleError: no design meets the specification.
        ClaimError: the design fails its certificate or its robust gate.
    """
    inputs = {
        "controller": request.controller,
        "specification": request.specification.to_document(),
        "disturbance_compensation": request.compensated,
        "code": _code_digest(),
    }
    place = folder / document_hash(design_inputs(request.robot, inputs))[:32]
    try:
        return read_artifact(place / JSON_NAME)
    except InputError:  # not there, or damaged: made again
        forget_input(place / JSON_NAME)
        design = _designed(replace(request, compensated=True), progress)
        made = checked_artifact(design if request.compensated else without_compensation(design))
        write_artifact(place, made)
        return made


def _designed(request: DesignRequest, progress: Progress) -> TrackingDesign:
    if request not in _designs:
        _designs[request] = synthesise(request, progress=progress)
    return _designs[request]


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
