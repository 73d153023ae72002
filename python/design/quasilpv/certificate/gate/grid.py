"""The robust gate of torque-level laws: growth rates of the frozen sampled loop on a grid, from the artifact alone.

An LMI certificate covers the design model in continuous time; it says nothing about a plant of another inertia, about
sampling, or about delay. With matrix gains the loop of n joints does not decouple into scalar ones, so there is no
proof like that of the acceleration-level law (`quasilpv.certificate.gate.proof`): the map from one sample to the next
is rebuilt from the shipped tables at every configuration and payload of a grid, and its spectral radius computed. Laws
that do not compensate gravity have it in their loop, as a stiffness. A grid check is no proof, and is reported as none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from flint import fmpq

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Evidence
from quasilpv.certificate.exact.program_values import program_values
from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot.data import PREMISES, inertia_data, inertia_table
from quasilpv.certificate.robot.range import InertiaPair, NeededRange, needed_range
from quasilpv.certificate.robot.registry import numeric_robot
from quasilpv.loops.frozen_loop import FrozenLaw
from quasilpv.loops.loop_grid import PAYLOAD_FRACTIONS, LoopGrid, WorstLoop, configurations

CURVE_FACTORS = 25
CURVE_REACH = 1.3

FrozenLawBuilder = Callable[[Shipped[Any], FloatArray], FrozenLaw]


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

    def why_not_passed(self) -> str:
        """Half a line: what was found."""
        return f"robust gate: not passed, worst growth rate {self.worst_case[0].growth_rate_per_s:.3g} 1/s"

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


def grid_gate(shipped: Shipped[Any], delay_samples: fmpq, freeze: FrozenLawBuilder) -> GridGate:
    """Put an artifact to the gate.

    Args:
        shipped: the artifact.
        delay_samples: the transport delay it has to tolerate, in samples.
        freeze: from the artifact and B configurations, (B, n), to its law there.

    Raises:
        InputError: a robot this gate does not know, a premise that leaves its box on the operating domain, or data that
            contradict each other.
    """
    data = inertia_data(shipped)
    pair, stabilises = InertiaPair(data), shipped.law.STABILISES
    angles = configurations(data.angle_rad, every_joint=stabilises or not data.turns_as_one)
    plants = LoopGrid(
        freeze(shipped, angles),
        angles,
        {f: pair.true_inertia_at(angles, f) for f in PAYLOAD_FRACTIONS},
        {f: _stiffness(shipped, angles, f) for f in PAYLOAD_FRACTIONS} if stabilises else None,
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


def _stiffness(shipped: Shipped[Any], angles: FloatArray, fraction: float) -> FloatArray:
    """Torque at rest with a payload as ``H(theta) theta``."""
    mass, com = ([1.0 + fraction * (scale - 1.0) for scale in scales] for scales in shipped.payloads.scales)
    return numeric_robot(shipped.mechanism, shipped.source).stiffness(mass, com, angles)


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


def premises_at(shipped: Shipped[Any], angles: FloatArray) -> FloatArray:
    """The outputs of the program ``premises`` at B configurations, (B, n): (B, p)."""
    columns = program_values(shipped.program(PREMISES).code, list(angles.T), [])
    return np.array(columns).reshape(len(columns), len(angles)).T


def inertia_at(shipped: Shipped[Any], angles: FloatArray) -> FloatArray:
    """The design inertia at B configurations, (B, n): (B, n, n); premises clamped to their box."""
    return VertexTable.of(inertia_table(shipped)).evaluate(premises_at(shipped, angles))
