"""Parts of the checker put to artifacts that are JSON trees, or only the members of one that a part reads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flint import fmpq

from quasilpv.certificate import HALF_A_SAMPLE, LAWS, Claim, gate, shipped
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.gate.grid import GridGate
from quasilpv.certificate.gate.loop import AccelerationLoopData
from quasilpv.certificate.gate.lyapunov import is_function_proved as function_proved
from quasilpv.certificate.gate.proof import MotionWitness, RobustGate
from quasilpv.certificate.laws import dob_acceleration, dob_torque, hinf_tracking
from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot import data, design_model
from quasilpv.certificate.robot.inertia import InertiaData
from quasilpv.documents.strict_model import validate
from quasilpv.documents.tables import PolytopeTable

Document = Mapping[str, Any]


def artifact_of(document: Document) -> Shipped[Any]:
    """An artifact as the checker sees it; members that no test of a part needs may be missing."""
    law = document["law"]
    n = len(law["inertia"]["blocks"][0]["vertices"][0])
    frame = {
        "schema": "quasilpv.artifact",
        "schema_version": 2,
        "name": "part",
        "creator": {"tool": "tests", "version": "1"},
        "design_hash": "0" * 64,
        "units": "SI",
        "sample_period_s": 1e-3,
        "joints": n,
        "robot": {"id": "none", "parameters": {}},
        "payloads": {},
        "domain": {"angle_rad": [[-1.0, 1.0]] * n, "speed_rad_s": [[-1.0, 1.0]] * n},
        "limits": {"torque_nm": [1.0] * n, "slew_nm_per_s": [1.0] * n},
        "programs": {},
        "witness": None,
        "verification": None,
    }
    return shipped(frame | dict(document))


def inequalities(document: Document) -> tuple[Claim, ...]:
    """The claims of a law without those about its design model."""
    own = artifact_of(document)
    return tuple(LAWS[own.law.kind].checks[0](own))


def check_design_model(document: Document) -> tuple[Claim, ...]:
    """The claims about its design model."""
    return design_model.check_design_model(artifact_of(document))


def inertia_data(document: Document) -> InertiaData:
    """The inertias of an artifact."""
    return data.inertia_data(artifact_of(document))


def loop_data(document: Document) -> AccelerationLoopData:
    """The scalar loop of a `dob-acceleration` artifact."""
    return dob_acceleration.loop_data(artifact_of(document))


def robust_gate(document: Document, delay_samples: fmpq = HALF_A_SAMPLE) -> RobustGate:
    """The gate of a `dob-acceleration` artifact."""
    found = gate(document, delay_samples=delay_samples)
    assert isinstance(found, RobustGate)
    return found


def grid_gate(document: Document, delay_samples: fmpq = HALF_A_SAMPLE) -> GridGate:
    """The gate of another one."""
    found = gate(document, delay_samples=delay_samples)
    assert isinstance(found, GridGate)
    return found


def is_function_proved(document: Document) -> bool:
    """Whether the Lyapunov function an artifact carries is proved."""
    own = artifact_of(document)
    claimed = own.witness(MotionWitness).motion
    assert claimed is not None
    loop = dob_acceleration.loop_data(own)
    return function_proved(claimed, own.law.lyapunov_bound, loop, own.artifact.joints)


def frozen_torque_law(document: Document, angles: Any) -> Any:
    """See `dob_torque.freeze`."""
    return dob_torque.freeze(artifact_of(document), angles)


def frozen_hinf_law(document: Document, angles: Any) -> Any:
    """See `hinf_tracking.freeze`."""
    return hinf_tracking.freeze(artifact_of(document), angles)


def vertex_table(table: Document) -> VertexTable:
    """A table of an artifact."""
    return VertexTable.of(validate(PolytopeTable, table, "table"))
