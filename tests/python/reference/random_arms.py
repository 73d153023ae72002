"""Random arms, and artifacts of every law for them, built with the package."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from quasilpv.artifact.compilation import compile_program
from quasilpv.documents.canonical import canonical_json, with_hash
from quasilpv.polytopes import BlockPolytope
from quasilpv.systems.descriptor.premise import AffineMatrix
from quasilpv.systems.robots.arm_parameters import Link as ArmLink
from quasilpv.systems.robots.arms import PlanarSerialArm
from reference.serial_arm import Link, SerialArm

SAMPLE_PERIOD_S = 1e-3


def random_arm(joints: int, rng: np.random.Generator) -> tuple[PlanarSerialArm, SerialArm]:
    """The same random arm twice: as the package describes it, and as the reference does."""
    links = []
    for _ in range(joints):
        length, mass = rng.uniform(0.3, 1.2), rng.uniform(1.0, 8.0)
        com = rng.uniform(0.1, 1.0) * length
        inertia = mass * com**2 + rng.uniform(0.02, 0.2) * mass * length**2
        links.append((length, mass, com, inertia, rng.uniform(0.0, 3.0)))
    arm = PlanarSerialArm("random", tuple(ArmLink(*link) for link in links))
    return arm, SerialArm(tuple(Link(*link) for link in links), arm.gravity_m_s2)


def artifact_document(
    arm: PlanarSerialArm, law: Mapping[str, Any], limits: Mapping[str, list[float]]
) -> dict[str, Any]:
    """Artifact with the given law (without its inertia table) for the arm; every premise ranges over [-1, 1]."""
    n = arm.joints
    affine: AffineMatrix = arm.inertia_affine()
    count = len(affine.coefficients)
    polytope = BlockPolytope.per_premise([-1.0] * count, [1.0] * count)
    vertices = polytope.vertices(affine.constant, affine.coefficients)
    inertia = polytope.to_document((vertices + np.swapaxes(vertices, 1, 2)) / 2)
    return with_hash(
        {
            "schema": "quasilpv.artifact",
            "schema_version": 2,
            "name": f"random-{law['kind']}",
            "creator": {"tool": "tests", "version": "1"},
            "design_hash": "0" * 64,
            "units": "SI",
            "sample_period_s": SAMPLE_PERIOD_S,
            "joints": n,
            "robot": {"id": "random", "parameters": arm.parameters_document()},
            "payloads": {},
            "domain": {"angle_rad": [[-4.0, 4.0]] * n, "speed_rad_s": [[-10.0, 10.0]] * n},
            "limits": limits,
            "programs": programs(arm, str(law["kind"])),
            "law": {**law, "inertia": inertia},
            "witness": None,
            "verification": None,
        }
    )


def artifact_bytes(arm: PlanarSerialArm, law: Mapping[str, Any], limits: Mapping[str, list[float]]) -> bytes:
    """JSON twin of `artifact_document`."""
    return canonical_json(artifact_document(arm, law, limits))


def programs(arm: PlanarSerialArm, kind: str) -> dict[str, Any]:
    """The programs a law kind needs, from the symbols of the arm."""
    model = arm.symbolic
    reference_speed = sp.symbols(f"v1:{arm.joints + 1}")
    inputs = {
        **{symbol: ("angle", joint) for joint, symbol in enumerate(model.theta)},
        **{symbol: ("speed", joint) for joint, symbol in enumerate(model.omega)},
        **{symbol: ("reference_speed", joint) for joint, symbol in enumerate(reference_speed)},
    }
    n = arm.joints
    cosines = [sp.cos(sum(model.theta[k + 1 : k + gap + 1])) for gap in range(1, n) for k in range(n - gap)]
    vectors = {"premises": cosines, "gravity": list(model.gravity)}
    if kind == "pid":
        vectors["coriolis_reference"] = list(model.coriolis * sp.Matrix(reference_speed))
    elif kind in ("ctc", "ctc-dob"):
        vectors["coriolis"] = list(model.coriolis * sp.Matrix(model.omega))
    elif kind in ("state-feedback", "descriptor-feedback", "delayed-feedback"):
        vectors["schedule"] = [sp.cos(model.theta[1]), model.omega[0] * sp.sin(model.theta[1])]
    return {name: compile_program(vector, inputs).model_dump(mode="json") for name, vector in vectors.items()}
