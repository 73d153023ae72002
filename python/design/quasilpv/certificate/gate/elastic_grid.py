"""The gate of laws of elastic joints that claim nothing, and what stands beside a proof on condition: a grid of loops.

From the artifact alone: postures x (empty, loaded at two opposite corners of the load's box) x (softest, stiffest gears
with their least damping) x rotors at both ends of their tolerance x both ends of the lag x (no delay, the specified
one); each loop is exact, all joints together. Postures are others than those that the design looked at. It proves
nothing between its points, and says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from flint import fmpq

from quasilpv.arrays import FloatArray
from quasilpv.certificate.exact.claims import Evidence
from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot.tree import TreeData
from quasilpv.certificate.robot.tree_range import TreePair
from quasilpv.documents.payloads import Gear, TreePayloads
from quasilpv.errors import InputError
from quasilpv.loops.elastic_loop import ElasticPlant

LABEL = "numerical (grid)"
POSTURES = 30
SEED = 19870131

Growth: TypeAlias = Callable[[ElasticPlant, FloatArray, float], float]
"""From an arm, the inertia of the law at its posture, (n, n), and a delay, s, to the growth rate of the loop, 1/s."""


@dataclass(frozen=True, eq=False)
class ElasticLoopPoint:
    """One loop of the grid.

    Attributes:
        angle_rad: the posture, (n,).
        loaded: whether with the largest load.
        gears: which end of their stiffness.
        rotors: factor on the nominal ones, (n,).
        lag_s, delay_s: of the drives, and of the way to them.
        growth_rate_per_s: negative when it is stable.
    """

    angle_rad: FloatArray
    loaded: bool
    gears: Literal["softest", "stiffest"]
    rotors: FloatArray
    lag_s: float
    delay_s: float
    growth_rate_per_s: float


@dataclass(frozen=True, eq=False)
class ElasticGridGate:
    """What the gate found; nothing of it is proved.

    Attributes:
        sample_period_s: of the law.
        specified_delay_s: the transport delay the design has to tolerate.
        loops: every loop that was looked at.
    """

    sample_period_s: float
    specified_delay_s: float
    loops: tuple[ElasticLoopPoint, ...]

    def __repr__(self) -> str:
        """The verdict in a line."""
        return f"ElasticGridGate(passed={self.passed}, evidence={self.evidence}, {LABEL})"

    @property
    def worst(self) -> ElasticLoopPoint:
        """The loop that grows fastest, or decays slowest."""
        return max(self.loops, key=lambda loop: loop.growth_rate_per_s)

    @property
    def passed(self) -> bool:
        """Whether every loop of the grid is stable."""
        return self.worst.growth_rate_per_s < 0.0

    @property
    def evidence(self) -> Evidence:
        """Eigenvalues in double arithmetic at the points of a grid."""
        return Evidence.SAMPLED

    @property
    def delay_margin_s(self) -> float | None:
        """The specified delay if every loop is stable, for longer ones were not tried; None if one is not."""
        return self.specified_delay_s if self.passed else None

    def why_not_passed(self) -> str:
        """Half a line: what was found."""
        return f"robust gate: not passed, worst growth rate {self.worst.growth_rate_per_s:.3g} 1/s, {LABEL}"

    def to_document(self) -> dict[str, Any]:
        """JSON-able: what ``design robust --json`` prints; `proved` is never true."""
        worst = self.worst
        return {
            "passed": self.passed,
            "proved": False,
            "evidence": self.evidence.value,
            "what": LABEL,
            "delay_margin_s": self.delay_margin_s,
            "loops": len(self.loops),
            "worst_growth_rate_per_s": worst.growth_rate_per_s,
            "where": {
                "angle_rad": worst.angle_rad.tolist(),
                "loaded": worst.loaded,
                "gears": worst.gears,
                "rotor_factors": worst.rotors.tolist(),
                "lag_s": worst.lag_s,
                "delay_s": worst.delay_s,
            },
        }


def elastic_grid_gate(shipped: Shipped[Any], delay_samples: fmpq, growth: Growth) -> ElasticGridGate:
    """Put an artifact to the gate.

    Args:
        shipped: the artifact.
        delay_samples: the transport delay it has to tolerate, in samples.
        growth: the frozen loop of its law.

    Raises:
        InputError: it states no gears, or its law has another chain than its robot.
    """
    payloads = shipped.payloads
    if not isinstance(payloads, TreePayloads) or payloads.gears is None:
        raise InputError(shipped.source, "payloads.gears", "none", "the gears of the joints, for a law of elastic ones")
    period = shipped.artifact.sample_period_s
    delay_s = to_float(delay_samples) * period
    grid = ElasticGrid(TreePair(TreeData.of(shipped)), payloads, payloads.gears)
    return ElasticGridGate(period, delay_s, tuple(grid.loops(growth, tuple(dict.fromkeys((0.0, delay_s))))))


@dataclass(frozen=True, eq=False)
class ElasticGrid:
    """The arms of the grid, from an artifact alone.

    Attributes:
        pair: the robot and the inertia of the law.
        payloads, gears: as stated.
    """

    pair: TreePair
    payloads: TreePayloads
    gears: tuple[Gear, ...]

    def loops(self, growth: Growth, delays_s: tuple[float, ...]) -> Iterator[ElasticLoopPoint]:
        """All of them, with these delays."""
        for plant, law, place in self._arms():
            for delay_s in delays_s:
                rate = growth(plant, law, delay_s)
                yield ElasticLoopPoint(**place, lag_s=plant.lag_s, delay_s=delay_s, growth_rate_per_s=rate)

    def _arms(self) -> Iterator[tuple[ElasticPlant, FloatArray, dict[str, Any]]]:
        low, high = np.array([(joint.lower, joint.upper) for joint in self.pair.data.joints]).T
        angles = np.random.default_rng(SEED).uniform(low, high, (POSTURES, len(low)))
        # Of drives that control torques the data have what the links feel of the rotors.
        gain = self.payloads.torque_gain or 1.0
        law, nominal = self.pair.design_inertia_at(angles), gain * self.pair.rotors
        for loaded, links in self._links(angles):
            for end, name in enumerate(("softest", "stiffest")):
                stiffness = np.array([gear.stiffness_nm_rad[end] for gear in self.gears])
                damping = stiffness * np.array([gear.damping_s[0] for gear in self.gears])
                for factors in self._rotor_factors():
                    for lag_s in dict.fromkeys(self.payloads.drive_lag_s):
                        for posture, own, design in zip(angles, links, law, strict=True):
                            plant = ElasticPlant(own, factors * nominal, stiffness, damping, lag_s, gain)
                            yield (
                                plant,
                                design,
                                {"angle_rad": posture, "loaded": loaded, "gears": name, "rotors": factors},
                            )

    def _links(self, angles: FloatArray) -> Iterator[tuple[bool, FloatArray]]:
        yield False, self.pair.links_at(angles, "lowest")[0]
        if self.payloads.load is not None:
            corners = self.pair.links_at(angles, "highest")
            for k in sorted({0, len(corners) - 1}):
                yield True, corners[k]

    def _rotor_factors(self) -> Iterator[FloatArray]:
        tolerance = np.array(self.payloads.rotor_tolerance)
        for sign in (-1.0, 1.0) if tolerance.any() else (0.0,):
            yield 1.0 + sign * tolerance
