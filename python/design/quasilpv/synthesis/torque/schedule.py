"""What a torque-level law is scheduled with, and `dob-torque` as vertex tables on that schedule."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.errors import InfeasibleError
from quasilpv.loops.frozen_loop import FrozenLaw
from quasilpv.loops.loop_grid import LoopGrid
from quasilpv.loops.torque_law import TorqueLaw
from quasilpv.polytopes import BlockPolytope
from quasilpv.synthesis.inertia_schedule import Schedule, schedule_of
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.systems.robots.registry import Robot

LARGEST_SPREAD = 3.0
"""Premises are scheduled as long as eig(M_i^-1 M_j) stays below this over all pairs of vertices. One observer matrix Q
in torque coordinates must serve all of them: already for a single joint the squared L2 gain grows tenfold per unit of
this ratio, and between 5 and 6 there is no Q at all."""


def schedule(robot: Robot) -> Schedule:
    """As many inertia premises as keep the spread below `LARGEST_SPREAD`; among equals the smallest spread.

    Raises:
        InfeasibleError: not even the empty set leaves a positive definite inertia.
    """
    count = len(robot.model.inertia_premises(robot.domain))
    for size in range(count, -1, -1):
        candidates = [schedule_of(robot, chosen) for chosen in itertools.combinations(range(count), size)]
        best = min(candidates, key=lambda candidate: candidate.spread)
        if best.spread < LARGEST_SPREAD:
            return best
    raise InfeasibleError(f"{robot.id}: no dob-torque design: the inertia at the middle of the box is not definite")


def full_schedule(robot: Robot) -> Schedule:
    """All inertia premises.

    Raises:
        InfeasibleError: at some corner of their box the inertia is not positive definite.
    """
    whole = schedule_of(robot, tuple(range(len(robot.model.inertia_premises(robot.domain)))))
    if math.isinf(whole.spread):
        raise InfeasibleError(f"{robot.id}: the nominal inertia is not definite at every corner of the premise box")
    return whole


@dataclass(frozen=True, eq=False)
class ScheduledLaw:
    """The law `dob-torque` as vertex tables on one polytope.

    Attributes:
        polytope: of the scheduled premises.
        inertia, feedback, observer: vertices, (N, n, n), (N, n, 3n), (N, 4n, n), SI.
        sample_period_s: T.
        filter_time_constant_s: T_f.
        premultiplication: vertices of beta, (N, n, n), see `Schedule`.
    """

    polytope: BlockPolytope
    inertia: FloatArray
    feedback: FloatArray
    observer: FloatArray
    sample_period_s: float
    filter_time_constant_s: float
    premultiplication: FloatArray | None = None

    def at(self, premises: FloatArray) -> TorqueLaw:
        """The law frozen at B premise vectors, (B, p), clamped to the box as the run-time side does."""
        weights = self.polytope.weights(self.polytope.saturate(premises)[0])
        tables = [self.inertia, self.feedback, self.observer]
        if self.premultiplication is not None:
            tables.append(self.premultiplication)
        frozen = (np.tensordot(weights, table, axes=1) for table in tables)
        return TorqueLaw(self.sample_period_s, self.filter_time_constant_s, *frozen)


class Scheduled(Protocol):
    """A law as vertex tables."""

    def at(self, premises: FloatArray, /) -> FrozenLaw:
        """The law frozen at B premise vectors, (B, p)."""


@dataclass(frozen=True, eq=False)
class ScheduledPlants:
    """A grid of plants and the scheduled premises at its configurations, (B, p)."""

    plants: PlantGrid
    premises: FloatArray

    @classmethod
    def of(cls, robot: Robot, scheduled: Schedule, plants: PlantGrid) -> ScheduledPlants:
        """Evaluate the premises of a robot on a grid."""
        return cls(plants, scheduled.premise_values(robot, plants.angles))

    def loops(self, law: Scheduled) -> LoopGrid:
        """A law against all plants."""
        return self.plants.loops(law.at(self.premises))
