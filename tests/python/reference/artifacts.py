"""Artifacts of the 3-DoF arm as JSON trees, one of every law, and changes that break a rule."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import pytest
import sympy as sp

from quasilpv.artifact import Artifact
from quasilpv.artifact.compilation import compile_program
from quasilpv.certificate import LAWS as LAW_KINDS
from quasilpv.errors import InputError
from quasilpv.polytopes import BlockPolytope
from quasilpv.systems.robots.registry import robot

Change: TypeAlias = Callable[[dict[str, Any]], None]

W = 47.12388980384690
GAINS = {"p": [24.28e4, 6.413e4, 8.66e3], "d": [5.152e3, 1.361e3, 183.8], "i": [3.814e6, 1.007e6, 1.36e5]}
LAWS: dict[str, dict[str, Any]] = {
    "dob-acceleration": {
        "feedback": {"kp": -3 * 60.0**2, "kd": -180.0, "ki": -(60.0**3)},
        "observer": [2.9, 2534.7, 1.0132e6, 1.5e8],
        "filter_time_constant_s": 1e-3,
        "disturbance_compensation": True,
    },
    "dob-torque": {"filter_time_constant_s": 5e-4},  # and gain tables, made with the inertia
    "pid": {**{f"k{name}": gains for name, gains in GAINS.items()}, "velocity_filter_time_constant_s": 2e-3},
    "ctc": {
        **{"gp": [3 * W**2] * 3, "gd": [3 * W] * 3, "gi": [W**3] * 3},
        "velocity_filter_time_constant_s": 2e-3,
        "disturbance_observer_bandwidth_rad_s": 0,
    },
    "ctc-dob": {
        **{"gp": [3 * W**2] * 3, "gd": [3 * W] * 3, "gi": [W**3] * 3},
        "velocity_filter_time_constant_s": 0.0,
        "disturbance_observer_bandwidth_rad_s": 50.0,
    },
}

SCHEDULE_GAINS = np.array([np.hstack([-(i + 3.0) * np.eye(3), -np.eye(3)]) for i in range(64)])
SCHEDULE_LYAPUNOV = np.array([np.diag([2.0 + i, 2.0, 2.0, 5.0, 5.0, 5.0]) for i in range(4)])


def schedule_table(vertices: Any) -> dict[str, Any]:
    """A table over the premises of ``schedule``."""
    return BlockPolytope.per_premise([-1.0, -2.0], [1.0, 2.0]).to_document(vertices)


STABILISING = {
    "state-feedback": {"gain": schedule_table(SCHEDULE_GAINS[:4])},
    "descriptor-feedback": {
        "numerator": schedule_table(SCHEDULE_GAINS[:4]),
        "lyapunov": SCHEDULE_LYAPUNOV[0].tolist(),
    },
    "delayed-feedback": {
        "lyapunov": schedule_table(SCHEDULE_LYAPUNOV),
        "numerators": SCHEDULE_GAINS.tolist(),
        "window_samples": 20,
        "descriptor": True,
    },
}
LAWS |= {kind: {**law, "velocity_filter_time_constant_s": 2e-3} for kind, law in STABILISING.items()}


def arm3_programs() -> dict[str, Any]:
    """The programs of the 3-DoF arm, compiled from its symbolic model."""
    arm3 = robot("arm3")
    symbolic = arm3.model.symbolic
    angles = {symbol: ("angle", i) for i, symbol in enumerate(symbolic.theta)}
    speeds = {symbol: ("speed", i) for i, symbol in enumerate(symbolic.omega)}
    rates = sp.symbols("rate_1:4", real=True)
    reference_speeds = {symbol: ("reference_speed", i) for i, symbol in enumerate(rates)}
    return {
        "premises": compile_program([premise.expression for premise in symbolic.inertia_premises(arm3.domain)], angles),
        "gravity": compile_program(list(symbolic.gravity), angles),
        "coriolis": compile_program(list(symbolic.coriolis * sp.Matrix(symbolic.omega)), {**angles, **speeds}),
        "schedule": compile_program(
            [sp.cos(symbolic.theta[1]), symbolic.omega[0] * sp.sin(symbolic.theta[1])], {**angles, **speeds}
        ),
        "coriolis_reference": compile_program(
            list(symbolic.coriolis * sp.Matrix(rates)), {**angles, **speeds, **reference_speeds}
        ),
    }


ARM3_PROGRAMS = {name: program.model_dump(mode="json") for name, program in arm3_programs().items()}


def arm3_document(kind: str = "dob-acceleration") -> dict[str, Any]:
    """A realistic artifact of the 3-DoF arm as a JSON tree."""
    arm3 = robot("arm3")
    bounds = [premise.bounds for premise in arm3.model.inertia_premises(arm3.domain)]
    polytope = BlockPolytope.per_premise(*np.array(bounds).T)
    affine = arm3.model.inertia_affine()
    inertia = polytope.to_document(polytope.vertices(affine.constant, affine.coefficients))
    law = {"kind": kind, **LAWS[kind], "inertia": inertia}
    if kind == "dob-torque":
        vertices = np.ones((polytope.vertex_count, 3, 9)) * np.arange(9.0)
        law["feedback"] = polytope.to_document(-vertices)
        law["observer"] = polytope.to_document(np.concatenate([vertices.swapaxes(1, 2), vertices[:, :, :3]], axis=1))
    document = {
        "schema": "quasilpv.artifact",
        "schema_version": 2,
        "name": f"arm3-{kind}-1000hz",
        "creator": {"tool": "design", "version": "0.1.0"},
        "design_hash": "5f" * 32,
        "units": "SI",
        "sample_period_s": 1e-3,
        "joints": 3,
        "robot": {"id": "arm3", "parameters": arm3.model.parameters_document()},
        "payloads": arm3.payloads.to_document(),
        "domain": arm3.domain.to_document(),
        "limits": arm3.limits.to_document(),
        "programs": {name: ARM3_PROGRAMS[name] for name in LAW_KINDS[kind].document.PROGRAMS},
        "law": law,
        "witness": {"condition": "chain-lmi", "P": [[1.5, 0.25], [0.25, 2.0]]},
        "verification": {"gate": {"margin": 0.03}},
    }
    return copy.deepcopy(document)


def at(*path: str | int, value: Any) -> Change:
    """A change of the document that sets the field at ``path``."""

    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return change


def without(*path: str | int) -> Change:
    """A change of the document that removes the field at ``path``."""

    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        del document[path[-1]]

    return change


def refusal(document: dict[str, Any], change: Change) -> InputError:
    """The error with which the document is refused once it is changed."""
    change(document)
    with pytest.raises(InputError) as error:
        Artifact.from_document(document, "artifact.json")
    return error.value
