"""Artifacts of general systems on disk, and what they hold for people."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from quasilpv.artifact.store import CBOR_NAME, JSON_NAME
from quasilpv.documents.canonical import canonical_cbor, canonical_json, parse_document
from quasilpv.documents.strict_model import validate
from quasilpv.documents.system_artifact import (
    SAMPLING_METHODS,
    SCHEMA,
    ObserverDocument,
    SystemArtifactDocument,
)
from quasilpv.files import read_bytes, write_atomically


def write_system_artifact(directory: Path | str, artifact: SystemArtifactDocument) -> tuple[Path, Path]:
    """Write both twins into ``directory``, which is created if needed; as `quasilpv.artifact.write_artifact`.

    Raises:
        InputError: the directory cannot be written; nothing half-written is left behind.
    """
    document = artifact.to_document()
    paths = Path(directory) / JSON_NAME, Path(directory) / CBOR_NAME
    write_atomically({paths[0]: canonical_json(document), paths[1]: canonical_cbor(document)})
    return paths


def read_system_artifact(path: Path | str) -> SystemArtifactDocument | None:
    """Read either twin; None if the file is an artifact of another kind.

    Raises:
        InputError: the file is missing, damaged, not canonical, or not a valid artifact of a system.
    """
    document = parse_document(read_bytes(path), str(path))
    if document.get("schema") != SCHEMA:
        return None
    content = {key: value for key, value in document.items() if key != "hash"}
    return validate(SystemArtifactDocument, content, str(path), SAMPLING_METHODS)


def system_summary(artifact: SystemArtifactDocument) -> dict[str, Any]:
    """What ``design inspect`` prints, as a JSON-able tree."""
    P = np.array(artifact.region.lyapunov)
    reach = np.sqrt(np.diag(P)).tolist()
    names = [signal.name for signal in artifact.states[: artifact.model.differential]]
    gain = artifact.law.gain
    return {
        "name": artifact.name,
        "hash": artifact.hash,
        "design_hash": artifact.design_hash,
        "creator": f"{artifact.creator.tool} {artifact.creator.version}",
        "law": f"u = K(z) ({', '.join(names)}), deviations from the trim; added, not subtracted"
        + ("" if artifact.observer is None else "; what is not measured is estimated"),
        "sample_period_s": artifact.sample_period_s,
        "decay_rate_per_s": artifact.region.decay_rate_per_s,
        "states": {signal.name: f"{_interval(signal)}, trim {signal.trim:.6g}" for signal in artifact.states},
        "inputs": {signal.name: f"{_interval(signal)}, trim {signal.trim:.6g}" for signal in artifact.inputs},
        "parameters": {
            signal.name: f"{_interval(signal)}, {'known' if signal.known else 'unknown'}"
            for signal in artifact.parameters
        },
        "region_reach": dict(zip(names, reach, strict=True)),
        **({} if artifact.observer is None else {"observer": _observer(artifact, artifact.observer)}),
        "largest_gain": float(np.abs([vertex for block in gain.blocks for vertex in block.vertices]).max()),
        "premises": dict(
            zip(
                artifact.model.names,
                map(list, zip(artifact.model.lower, artifact.model.upper, strict=True)),
                strict=True,
            )
        ),
        "premise_outside": _outside(artifact.law.premise_fault_s),
        "vertices": gain.vertex_count,
        "instructions": {
            "schedule": len(artifact.law.schedule.code),
            "residual": len(artifact.plant.residual.code),
            "jacobian": sum(len(row.code) for row in artifact.plant.jacobian),
        },
        **({} if artifact.l2_gain is None else {"l2_gain": artifact.l2_gain[0], "energy_s": artifact.l2_gain[1]}),
        "sampling": "not proved" if artifact.sampling is None else artifact.sampling.model_dump(mode="json"),
        "verification": artifact.verification,
    }


def _outside(fault_s: float | None) -> str:
    """The policy where a premise is outside its box, in words."""
    if fault_s is None:
        return "clamped, no fault"
    return "a fault at once" if fault_s == 0.0 else f"clamped, a fault after {fault_s:g} s"


def _observer(artifact: SystemArtifactDocument, own: ObserverDocument) -> dict[str, Any]:
    """``largest_error`` is that of one estimate alone, at the trim: ``nu |e|_Q = 1`` there."""
    states = artifact.states[: artifact.model.differential]
    alone = 1.0 / (own.weight * np.sqrt(np.diag(np.linalg.inv(np.array(own.lyapunov)))))
    return {
        "measured": list(own.measured),
        "start": {
            signal.name: signal.trim + value
            for signal, value in zip(states, own.start, strict=True)
            if signal.name not in own.measured
        },
        "largest_error": {
            signal.name: float(value)
            for signal, value in zip(states, alone, strict=True)
            if signal.name not in own.measured
        },
        "largest_gain": float(np.abs(own.gain).max()),
        "weight": own.weight,
    }


def _interval(signal: Any) -> str:
    ends = (signal.low, signal.high)
    return " to ".join("unbounded" if end is None else f"{end + signal.trim:.6g}" for end in ends)
