"""The robust gate of torque-level laws: growth rates of the frozen sampled loop on a grid, from the artifact alone.

An LMI certificate covers the design model in continuous time; it says nothing about a plant of another inertia, about
sampling, or about delay. With matrix gains the loop of n joints does not decouple into scalar ones, so there is no
proof like that of the acceleration-level law (`quasilpv.certificate.gate`): the map from one sample to the next is
rebuilt from the shipped tables at every configuration and payload of a grid, and its spectral radius computed. Laws
that do not compensate gravity have it in their loop, as a stiffness. A grid check is no proof, and is reported as none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from flint import fmpq

from quasilpv.arrays import FloatArray
from quasilpv.certificate.claims import Evidence
from quasilpv.certificate.gate_data import HALF_A_SAMPLE, inertia_data, law_kind
from quasilpv.certificate.gate_range import InertiaPair, NeededRange, needed_range
from quasilpv.certificate.gate_rationals import to_float
from quasilpv.certificate.program_values import program_values
from quasilpv.certificate.robot_dynamics import gravity_stiffness
from quasilpv.certificate.vertex_tables import VertexTable
from quasilpv.loops.frozen_loop import FrozenLaw
from quasilpv.loops.hinf_law import hinf_tracking_law
from quasilpv.loops.loop_grid import PAYLOAD_FRACTIONS, LoopGrid, WorstLoop, configurations
from quasilpv.loops.state_law import StateLaw, descriptor_gain
from quasilpv.loops.torque_law import TorqueLaw
from quasilpv.loops.velocity_law import VelocityLaw

CURVE_FACTORS = 25
CURVE_REACH = 1.3

FrozenLawBuilder = Callable[[Mapping[str, Any], FloatArray], FrozenLaw]


@dataclass(frozen=True)
class GridGate:
    """What the gate found. Nothing but the needed range is proved.

    Attributes:
        plants: the law against every plant of the grid.
        specified_delay_s: the transport delay the design has to tolerate.
        worst: by case ``no_delay`` and ``specified_delay``.
        margin: the interval of ``M_t / M_n`` around 1 on which the loops with plants ``M_t = rho M_n``, one factor rho
            for all joints, are stable with the specified delay; None if they are not at 1.
        factors: the interval around 1 by which all true inertias of the grid may be multiplied at the specified delay;
            None if a loop is unstable as it is.
        delay_margin_s: the delay up to which all loops are stable; None if one is unstable without delay.
        needed: which ratios ``M_t / M_n`` occur, proved; None if no bounds could be proved.
    """

    plants: LoopGrid
    specified_delay_s: float
    worst: Mapping[str, WorstLoop]
    margin: tuple[float, float] | None
    factors: tuple[float, float] | None
    delay_margin_s: float | None
    needed: NeededRange | None

    def __repr__(self) -> str:
        """The verdict in a line."""
        return f"GridGate(passed={self.passed}, evidence={self.evidence}, delay_margin_s={self.delay_margin_s})"

    @property
    def passed(self) -> bool:
        """Whether every loop of the grid is stable at all delays tried up to the specified one, that one included."""
        stable = all(worst.growth_rate_per_s < 0.0 for worst in self.worst.values())
        return stable and self.delay_margin_s is not None and self.delay_margin_s >= self.specified_delay_s

    @property
    def worst_case(self) -> tuple[WorstLoop, float]:
        """The largest growth rate over both cases, and the delay it occurs at, s."""
        case = max(self.worst, key=lambda name: self.worst[name].growth_rate_per_s)
        return self.worst[case], 0.0 if case == "no_delay" else self.specified_delay_s

    @property
    def evidence(self) -> Evidence:
        """Eigenvalues in double arithmetic at the points of a grid."""
        return Evidence.SAMPLED

    def to_document(self) -> dict[str, Any]:
        """JSON-able: what ``design robust --json`` prints. null stands for no value; `proved` is never true."""
        worst, delay_s = self.worst_case
        return {
            "passed": self.passed,
            "proved": False,
            "evidence": self.evidence.value,
            "inertia_margin": None if self.margin is None else list(self.margin),
            "delay_margin_s": self.delay_margin_s,
            "needed_range": None if self.needed is None else list(self.needed.to_floats()),
            "worst_growth_rate_per_s": worst.growth_rate_per_s,
            "where": {
                "angle_rad": list(worst.angle_rad),
                "payload_fraction": worst.payload_fraction,
                "delay_s": delay_s,
            },
            "growth_rates_per_s": {case: found.growth_rate_per_s for case, found in self.worst.items()},
            "inertia_factors": None if self.factors is None else list(self.factors),
            "grid": {"configurations": len(self.plants.angles), "payload_fractions": list(self.plants.inertia)},
        }


def grid_gate(document: Mapping[str, Any], source: str = "artifact", delay_samples: fmpq = HALF_A_SAMPLE) -> GridGate:
    """Put an artifact to the gate.

    Args:
        document: the artifact as a JSON tree.
        source: what to call it in errors.
        delay_samples: the transport delay it has to tolerate, in samples.

    Raises:
        InputError: a law or a robot this gate does not know, a premise that leaves its box
            on the operating domain, or data that contradict each other.
    """
    kind = law_kind(document, source, FROZEN_LAWS)
    data = inertia_data(document, source)
    pair, stabilises = InertiaPair(data), kind in STABILISING
    angles = configurations(data.angle_rad, every_joint=stabilises or not data.turns_as_one)
    plants = LoopGrid(
        FROZEN_LAWS[kind](document, angles),
        angles,
        {f: pair.true_inertia_at(angles, f) for f in PAYLOAD_FRACTIONS},
        {f: gravity_stiffness(document, angles, f) for f in PAYLOAD_FRACTIONS} if stabilises else None,
    )
    delay_s = to_float(delay_samples) * plants.law.sample_period_s
    return GridGate(
        plants=plants,
        specified_delay_s=delay_s,
        worst={"no_delay": plants.worst(), "specified_delay": plants.worst(delay_s=delay_s)},
        margin=replace(plants, inertia={0.0: pair.design_inertia_at(angles)}).factor_range(delay_s),
        factors=plants.factor_range(delay_s),
        delay_margin_s=plants.delay_margin_s(delay_s),
        needed=needed_range(pair),
    )


@dataclass(frozen=True, eq=False)
class GrowthCurve:
    """Worst growth rate over the grid against a common factor on all true inertias.

    Attributes:
        delay_s: transport delay.
        factors: (N,).
        rates_per_s: (N,).
    """

    delay_s: float
    factors: FloatArray
    rates_per_s: FloatArray


def growth_curves(gate: GridGate, points: int = CURVE_FACTORS) -> tuple[GrowthCurve, ...]:
    """The worst growth rate at no delay, at the specified one and at twice that, a little beyond the stable factors."""
    low, high = gate.factors or (0.5, 2.0)
    factors = np.geomspace(low / CURVE_REACH, high * CURVE_REACH, points)
    return tuple(
        GrowthCurve(delay, factors, np.array([gate.plants.worst(f, delay).growth_rate_per_s for f in factors.tolist()]))
        for delay in (0.0, gate.specified_delay_s, 2.0 * gate.specified_delay_s)
    )


def frozen_torque_law(document: Mapping[str, Any], angles: FloatArray) -> TorqueLaw:
    """The law `dob-torque` of an artifact at B configurations, (B, n), its premises clamped to their box."""
    law = document["law"]
    names = [name for name in ("inertia", "feedback", "observer", "premultiplication") if name in law]
    premises = _premises_at(document, angles)
    return TorqueLaw(
        sample_period_s=float(document["sample_period_s"]),
        filter_time_constant_s=float(law["filter_time_constant_s"]),
        **{name: VertexTable.parse(law[name]).evaluate(premises) for name in names},
    )


def _premises_at(document: Mapping[str, Any], angles: FloatArray) -> FloatArray:
    """The outputs of the program ``premises``, (B, p)."""
    columns = program_values(document["programs"]["premises"], list(angles.T), [])
    return np.array(columns).reshape(len(columns), len(angles)).T


def frozen_hinf_law(document: Mapping[str, Any], angles: FloatArray) -> VelocityLaw:
    """The law `hinf-tracking` of an artifact at B configurations, (B, n), its premises clamped to their box."""
    law = document["law"]
    premises = _premises_at(document, angles)
    numerator, inertia = (VertexTable.parse(law[name]).evaluate(premises) for name in ("numerator", "inertia"))
    return hinf_tracking_law(
        float(document["sample_period_s"]),
        float(law["velocity_filter_time_constant_s"]),
        numerator,
        inertia,
        np.array(law["lyapunov"], dtype=float),
    )


def frozen_stabilising_law(document: Mapping[str, Any], angles: FloatArray) -> StateLaw:
    """A stabilising law of an artifact at rest at B configurations, (B, n): its window, if any, is filled with them."""
    law = document["law"]
    at_rest = list(0.0 * angles.T)
    premises = np.column_stack(program_values(document["programs"]["schedule"], list(angles.T), at_rest))
    inertia = VertexTable.parse(law["inertia"]).evaluate(_premises_at(document, angles))
    return StateLaw(
        float(document["sample_period_s"]),
        _STABILISING_GAINS[law["kind"]](law, premises, inertia),
        float(law["velocity_filter_time_constant_s"]),
    )


def _state_gain(law: Mapping[str, Any], premises: FloatArray, inertia: FloatArray) -> FloatArray:
    return VertexTable.parse(law["gain"]).evaluate(premises)


def _descriptor_gain(law: Mapping[str, Any], premises: FloatArray, inertia: FloatArray) -> FloatArray:
    numerator = VertexTable.parse(law["numerator"]).evaluate(premises)
    return descriptor_gain(numerator, inertia, np.array(law["lyapunov"], dtype=float))


def _delayed_gain(law: Mapping[str, Any], premises: FloatArray, inertia: FloatArray) -> FloatArray:
    table = VertexTable.parse(law["lyapunov"])
    weights, P = table.weights(premises), table.evaluate(premises)
    count = weights.shape[1]
    cube = np.array(law["numerators"], dtype=float).reshape(count, count, count, *np.shape(law["numerators"][0]))
    numerator = np.einsum("zj,zk,zm,jkmab->zab", weights, weights, weights, cube)
    if law["descriptor"]:
        return descriptor_gain(numerator, inertia, P)
    return np.asarray(np.linalg.solve(P, numerator.swapaxes(1, 2)).swapaxes(1, 2))


_STABILISING_GAINS: Mapping[str, Callable[[Mapping[str, Any], FloatArray, FloatArray], FloatArray]] = {
    "state-feedback": _state_gain,
    "descriptor-feedback": _descriptor_gain,
    "delayed-feedback": _delayed_gain,
}

STABILISING = tuple(_STABILISING_GAINS)
"""The law kinds with gravity in their loop."""

FROZEN_LAWS: Mapping[str, FrozenLawBuilder] = {
    "dob-torque": frozen_torque_law,
    "hinf-tracking": frozen_hinf_law,
    **dict.fromkeys(STABILISING, frozen_stabilising_law),
}
"""How each law kind without a proof is frozen; a new one is one function here."""
