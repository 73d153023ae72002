"""Artifacts on disk: both twins written together, either twin read back; comparison and summary for people."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from quasilpv.artifact.envelope import envelope_summary
from quasilpv.artifact.schema import Artifact
from quasilpv.documents.canonical import canonical_cbor, canonical_json, member_path, parse_document
from quasilpv.documents.mechanism import Tree
from quasilpv.documents.system_artifact import SCHEMA as SYSTEM_SCHEMA
from quasilpv.documents.tables import PolytopeTable
from quasilpv.errors import InputError
from quasilpv.files import read_bytes, write_atomically

JSON_NAME = "artifact.json"
CBOR_NAME = "artifact.cbor"


@dataclass(frozen=True)
class Difference:
    """One field in which two documents differ; ``None`` stands for a missing member (and for null)."""

    path: str
    left: Any
    right: Any


def write_artifact(directory: Path | str, artifact: Artifact) -> tuple[Path, Path]:
    """Write ``artifact.json`` and ``artifact.cbor`` into ``directory``, which is created if needed.

    Returns:
        The paths of the JSON and the CBOR twin.

    Raises:
        InputError: the directory cannot be written; nothing half-written is left behind.
    """
    directory = Path(directory)
    document = artifact.to_document()
    paths = directory / JSON_NAME, directory / CBOR_NAME
    write_atomically({paths[0]: canonical_json(document), paths[1]: canonical_cbor(document)})
    return paths


def read_artifact(path: Path | str) -> Artifact:
    """Read either twin of an artifact.

    Raises:
        InputError: the file is missing, damaged, not canonical, or not a valid artifact.
    """
    source = str(path)
    document = parse_document(read_bytes(path), source)
    if document.get("schema") == SYSTEM_SCHEMA:
        raise InputError(
            source,
            "schema",
            "a controller of a system",
            "one of a robot; of systems: verify, robust, inspect, simulate, hil, animate, export",
        )
    return Artifact.from_document(document, source)


def diff(left: Artifact, right: Artifact) -> list[Difference]:
    """Return the fields in which two artifacts differ, in the order of their paths; empty if they are equal."""
    return list(_differences(left.content(), right.content(), ""))


def summary(artifact: Artifact) -> dict[str, Any]:
    """Return what ``design inspect`` prints: identity, sizes, law and the results of checks, as a JSON-able tree."""
    law = artifact.law
    tables = {"kind", "inertia"}
    return {
        "name": artifact.name,
        "hash": artifact.hash,
        "design_hash": artifact.design_hash,
        "creator": f"{artifact.creator.tool} {artifact.creator.version}",
        "robot": artifact.robot.id,
        "joints": artifact.joints,
        "sample_period_s": artifact.sample_period_s,
        "law": law.kind,
        "gains": {key: value for key, value in law.model_dump(mode="json").items() if key not in tables},
        **_inertia_summary(law.inertia),
        "programs": {name: len(program.code) for name, program in sorted(artifact.programs.items())},
        "torque_limit_nm": list(artifact.limits.torque_nm),
        "slew_limit_nm_per_s": list(artifact.limits.slew_nm_per_s),
        "witness": artifact.witness is not None,
        "envelope": envelope_summary(artifact),
        "verification": artifact.verification,
    }


def _inertia_summary(inertia: PolytopeTable | Tree) -> dict[str, Any]:
    """Sizes of a table; of a robot, its kind and its joints."""
    if isinstance(inertia, Tree):
        return {"design_inertia": inertia.kind, "bodies": inertia.joints}
    return {
        "premises": inertia.premises,
        "blocks": [len(block.premises) for block in inertia.blocks],
        "vertices": inertia.vertex_count,
    }


def _differences(left: Any, right: Any, path: str) -> Iterator[Difference]:
    if isinstance(left, dict) and isinstance(right, dict):
        for key in sorted(left.keys() | right.keys()):
            yield from _differences(left.get(key), right.get(key), member_path(path, key))
    elif isinstance(left, list) and isinstance(right, list) and len(left) == len(right):
        for i, (a, b) in enumerate(zip(left, right, strict=True)):
            yield from _differences(a, b, f"{path}[{i}]")
    elif left != right:
        yield Difference(path, left, right)
