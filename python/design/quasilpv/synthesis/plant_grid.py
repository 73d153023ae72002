"""The plants a search evaluates its loops with: a robot over a grid of configurations and payload fractions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.loops.frozen_loop import FrozenLaw
from quasilpv.loops.loop_grid import CONFIGURATIONS, PAYLOAD_FRACTIONS, LoopGrid, configurations
from quasilpv.systems.robots.registry import Robot

SCREEN_CONFIGURATIONS = 9
SCREEN_PAYLOADS = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class PlantGrid:
    """Nominal and true inertias.

    Attributes:
        angles: (B, n), rad.
        nominal: nominal inertia there, (B, n, n), kg m^2.
        inertia: true inertia by payload fraction, (B, n, n) each.
    """

    angles: FloatArray
    nominal: FloatArray
    inertia: dict[float, FloatArray]

    @classmethod
    def over(cls, robot: Robot, count: int, fractions: tuple[float, ...]) -> PlantGrid:
        """The grid of about ``count`` configurations of the robot's operating domain."""
        angles = configurations(robot.domain.angle_rad, count, every_joint=not robot.model.turns_as_one)
        plants = {fraction: robot.with_payload_fraction(fraction) for fraction in fractions}
        return cls(
            angles,
            np.array([robot.model.inertia(theta) for theta in angles]),
            {f: np.array([plant.inertia(theta) for theta in angles]) for f, plant in plants.items()},
        )

    @classmethod
    def screen(cls, robot: Robot) -> PlantGrid:
        """The coarse grid that candidates are tried on."""
        return cls.over(robot, SCREEN_CONFIGURATIONS, SCREEN_PAYLOADS)

    @classmethod
    def full(cls, robot: Robot) -> PlantGrid:
        """The grid of the robust gate."""
        return cls.over(robot, CONFIGURATIONS, PAYLOAD_FRACTIONS)

    def loops(self, law: FrozenLaw) -> LoopGrid:
        """A law, frozen at the configurations of the grid, against all plants."""
        return LoopGrid(law, self.angles, self.inertia)
