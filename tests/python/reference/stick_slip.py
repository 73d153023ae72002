"""Friction with stick and slip in numpy, twice: the bristle of the simulator, and Karnopp's, which knows no bristle.

The second one is solved from event to event, each piece of the motion by its closed form or by scipy, and shares no
equation with the first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from quasilpv.arrays import FloatArray


@dataclass(frozen=True)
class Bristle:
    """Friction with a bristle; torques in N m, deflections in parts of the largest one at rest."""

    viscous: float
    coulomb: float
    breakaway: float
    stribeck: float
    presliding: float
    damping: float

    def slip(self, w: float, b: float) -> float:
        """How much of the speed bends the bristle: 1 sticks, 0 slides."""
        level = self.coulomb + (self.breakaway - self.coulomb) * np.exp(-((w / self.stribeck) ** 2))
        ratio = self.breakaway * b * np.sign(w) / level
        share = 0.0 if ratio <= 0.8 else 1.0 if ratio >= 1.0 else 0.5 * (1.0 + np.sin(np.pi * (ratio - 0.9) / 0.2))
        return 1.0 - share * ratio

    def torque(self, w: float, b: float) -> float:
        """Against the motion."""
        damping = self.damping / (1.0 + self.damping * abs(w) / (4.0 * self.coulomb))
        return self.breakaway * b + damping * w * self.slip(w, b) + self.viscous * w

    def rate(self, w: float, b: float) -> float:
        """Of the bristle."""
        return w * self.slip(w, b) / self.presliding

    def energy(self, b: float) -> float:
        """In the bristle, J."""
        return 0.5 * self.breakaway * self.presliding * b * b

    def document(self) -> dict[str, float]:
        """The ``stick_slip`` member of a joint."""
        return {
            "breakaway_nm": self.breakaway,
            "stribeck_speed_rad_s": self.stribeck,
            "presliding_rad": self.presliding,
            "presliding_damping_nm_s": self.damping,
        }


def karnopp_pulled(
    inertia: float, friction: Bristle, *, stiffness: float, pull: float, time_s: float
) -> tuple[FloatArray, FloatArray]:
    """Times and sizes of the slips of a disc at rest that a spring pulls, its far end turning at a constant speed.

    Of the friction there are Coulomb's and the break-away torque.

    It sticks until the spring's torque is the break-away torque, then moves under the spring and Coulomb's torque until
    its speed is zero again, where it sticks if the spring cannot break it away. Slips of undamped sliding are half
    periods of the spring: how they begin does not depend on a bristle.
    """
    coulomb, breakaway = friction.coulomb, friction.breakaway
    angle, time, begun, sizes = 0.0, 0.0, [], []
    while True:
        start = max(time, (breakaway / stiffness + angle) / pull)
        if start > time_s:
            return np.array(begun), np.array(sizes)

        def stops(_: float, y: FloatArray) -> float:
            return float(y[1])

        stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
        found = solve_ivp(
            lambda t, y: [y[1], (stiffness * (pull * t - y[0]) - coulomb) / inertia],
            (start, start + 10.0),
            [angle, 1e-12],
            events=stops,
            rtol=1e-10,
            atol=1e-12,
            max_step=1e-3,
        )
        time, ended = float(found.t[-1]), float(found.y[0, -1])
        begun.append(start)
        sizes.append(ended - angle)
        angle = ended
