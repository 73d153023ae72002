"""Designs that need not be made again: shipped ones, and those kept on disk under the hash of all their inputs.

A shipped design is one that `tools/ship-designs` made. It is taken where it is the answer to exactly what is asked for,
and its certificate and its gate are decided anew, from the file alone.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache
from pathlib import Path

from flint import fmpq

import quasilpv
from quasilpv.artifact import Artifact, read_artifact, write_artifact
from quasilpv.artifact.store import JSON_NAME
from quasilpv.certificate import LAWS, gate, verify
from quasilpv.documents.canonical import document_hash
from quasilpv.errors import ClaimError, InputError
from quasilpv.experiments.track import require_robot_of
from quasilpv.files import forget_input
from quasilpv.progress import Progress, no_progress
from quasilpv.release import checked_artifact, design_inputs
from quasilpv.synthesis import DesignRequest, synthesise, without_compensation
from quasilpv.synthesis.tracking_design import TrackingDesign

DEFAULT_CACHE = Path("out/cache")
SHIPPED = Path(__file__).parent / "shipped"
"""Artifacts, ``ROBOT/CONTROLLER.json``."""

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
    """The artifact of a design: a shipped one, or one from the cache if the same design was made before.

    Args:
        request: what is asked for; the gains are searched for once, with compensation and without.
        folder: the cache; each design is a folder of it, named by the hash of its inputs and of the design code.
        progress: called with (points done, points in all) while a design is made.

    Raises:
        InputError: unknown controller, or the cache cannot be written.
        InfeasibleError: no design meets the specification.
        ClaimError: the design, shipped or not, fails its certificate or its robust gate.
    """
    shipped = shipped_design(request)
    if shipped is not None:
        return shipped
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


def shipped_design(request: DesignRequest) -> Artifact | None:
    """The shipped artifact of a design, verified anew; None if none is shipped for this robot and specification.

    Raises:
        InputError: the shipped file is damaged, or is for another robot of this name.
        ClaimError: it fails its certificate or its robust gate.
    """
    path = SHIPPED / request.robot.id / f"{request.controller}.json"
    if not request.compensated or not path.is_file():
        return None
    artifact = read_artifact(path)
    inputs = {"controller": request.controller, "specification": request.specification.to_document()}
    if artifact.design_hash != document_hash(design_inputs(request.robot, inputs)):
        return None
    require_robot_of(artifact, request.robot)
    if LAWS[artifact.law.kind].claims_of(artifact):
        delay = fmpq(*request.specification.delay_samples.as_integer_ratio())
        if not (verify(artifact, artifact.name).verified and gate(artifact, artifact.name, delay).passed):
            raise ClaimError(f"{path}: the certificate or the robust gate of a shipped design does not hold")
    return artifact


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
