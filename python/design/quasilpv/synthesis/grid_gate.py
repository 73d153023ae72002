"""The robust gate of torque-level laws: growth rates of the frozen sampled loop on a grid.

An LMI certificate covers the design model; it says nothing about a plant of another inertia, nor about sampling. The
gate asks what the theorem does not: with the true inertia of every payload, at every configuration of a grid over the
operating domain, with and without transport delay, and with the inertia wrong by a further factor both ways, is the
sampled loop stable? A grid check is no proof, and is reported as none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from quasilpv.polytopes import BlockPolytope
from quasilpv.synthesis.inertia_range import configurations
from quasilpv.synthesis.torque_loop import FrozenLaw, TorqueLoop
from quasilpv.systems.premise import Premise
from quasilpv.systems.registry import Robot

FloatArray = npt.NDArray[np.float64]

CONFIGURATIONS = 64
PAYLOAD_FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, eq=False)
class ScheduledLaw:
    """The law `dob-torque` as vertex tables on one polytope.

    Attributes:
        polytope: of the scheduled premises.
        inertia, feedback, observer: vertices, (N, n, n), (N, n, 3n), (N, 4n, n), SI.
        sample_period_s: T.
        filter_time_constant_s: T_f.
    """

    polytope: BlockPolytope
    inertia: FloatArray
    feedback: FloatArray
    observer: FloatArray
    sample_period_s: float
    filter_time_constant_s: float

    def at(self, premises: FloatArray) -> FrozenLaw:
        """The law frozen at B premise vectors, (B, p), clamped to the box as the run-time side does."""
        weights = self.polytope.weights(self.polytope.saturate(premises)[0])
        tables = (np.tensordot(weights, table, axes=1) for table in (self.inertia, self.feedback, self.observer))
        return FrozenLaw(self.sample_period_s, self.filter_time_constant_s, *tables)


@dataclass(frozen=True, eq=False)
class PlantGrid:
    """True inertias over a grid of configurations and payload fractions.

    Attributes:
        angles: (B, n), rad.
        premises: scheduled premises there, (B, p).
        inertia: true inertia by payload fraction, (B, n, n) each.
    """

    angles: FloatArray
    premises: FloatArray
    inertia: dict[float, FloatArray]

    @classmethod
    def over(cls, robot: Robot, scheduled: tuple[Premise, ...], count: int, fractions: tuple[float, ...]) -> PlantGrid:
        """The grid of about ``count`` configurations of the robot's operating domain."""
        angles = configurations(robot, count)
        evaluate = sp.lambdify(robot.model.symbolic.theta, [premise.expression for premise in scheduled])
        premises = np.array([evaluate(*theta) for theta in angles], dtype=float).reshape(len(angles), len(scheduled))
        plants = {fraction: robot.with_payload_fraction(fraction) for fraction in fractions}
        inertia = {f: np.array([plant.inertia(theta) for theta in angles]) for f, plant in plants.items()}
        return cls(angles, premises, inertia)

    def loops(
        self, law: ScheduledLaw, factors: tuple[float, ...], delay_s: float
    ) -> Iterator[tuple[float, TorqueLoop]]:
        """Payload fraction and loops (one per configuration) for every fraction and every factor on the inertia."""
        frozen = law.at(self.premises)
        for fraction, inertia in self.inertia.items():
            for factor in factors:
                yield fraction, TorqueLoop(frozen, factor * inertia, delay_s)


@dataclass(frozen=True)
class GateResult:
    """What the gate found.

    Attributes:
        passed: every loop is stable, also with the inertia wrong by the spare factor both ways.
        worst_growth_rate_per_s: over configurations and payloads, specified delay included, without the spare factor.
        where: joint angles (rad) and payload fraction of the worst growth rate.
        rates_per_s: worst growth rate by case: ``no_delay``, ``specified_delay``, ``with_spare`` (delay and factor).
        loops: number of loops evaluated.
    """

    passed: bool
    worst_growth_rate_per_s: float
    where: tuple[tuple[float, ...], float]
    rates_per_s: dict[str, float]
    loops: int

    def report(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "passed": self.passed,
            "proved": False,
            "worst_growth_rate_per_s": self.worst_growth_rate_per_s,
            "worst_growth_rate_at": {"angle_rad": list(self.where[0]), "payload_fraction": self.where[1]},
            "growth_rates_per_s": self.rates_per_s,
            "loops": self.loops,
        }


def grid_gate(law: ScheduledLaw, grid: PlantGrid, delay_s: float, spare: float) -> GateResult:
    """Growth rates of the frozen sampled loop on a grid of configurations, payloads and transport delays.

    Args:
        law: vertex tables.
        grid: configurations and true inertias.
        delay_s: transport delay that must be tolerated.
        spare: factor by which the true inertia may be larger or smaller than on the grid.
    """
    cases = {
        "no_delay": ((1.0,), 0.0),
        "specified_delay": ((1.0,), delay_s),
        "with_spare": ((1 / spare, spare), delay_s),
    }
    rates, places, loops = {}, {}, 0
    for case, (factors, delay) in cases.items():
        found = []
        for fraction, loop in grid.loops(law, factors, delay):
            growth = loop.growth_rates()
            worst = int(np.argmax(growth))
            found.append((float(growth[worst]), (tuple(map(float, grid.angles[worst])), fraction)))
            loops += len(growth)
        rates[case], places[case] = max(found)
    worst_case = max(("no_delay", "specified_delay"), key=lambda case: rates[case])
    return GateResult(
        passed=max(rates.values()) < 0.0,
        worst_growth_rate_per_s=rates[worst_case],
        where=places[worst_case],
        rates_per_s=rates,
        loops=loops,
    )
