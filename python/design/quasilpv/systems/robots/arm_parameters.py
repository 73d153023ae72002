"""The data a planar serial arm is described by: links, operating domain, actuator limits, payload set."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from quasilpv.errors import InputError

Interval = tuple[float, float]


@dataclass(frozen=True)
class Link:
    """One rigid link, its centre of mass on the line from its joint to the next one.

    Attributes:
        length_m: distance from this link's joint axis to the next one (or to the tool), L > 0.
        mass_kg: mass, m > 0.
        com_m: distance from this link's joint axis to its centre of mass, r.
        inertia_kg_m2: moment of inertia about the link's *joint axis*, I >= m r^2.
        friction_nm_s: viscous friction of the joint, f >= 0, in N m s/rad.

    Raises:
        InputError: a value is not finite or out of range. In particular I < m r^2 makes the moment of inertia about the
            centre of mass negative, and the inertia matrix of an arm with such a link indefinite.
    """

    length_m: float
    mass_kg: float
    com_m: float
    inertia_kg_m2: float
    friction_nm_s: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is not a rigid body."""
        for field, value in asdict(self).items():
            if not isfinite(value):
                raise InputError("link", field, value, "a finite number")
        for field, value in (("length_m", self.length_m), ("mass_kg", self.mass_kg)):
            if value <= 0:
                raise InputError("link", field, value, "a number > 0")
        if self.friction_nm_s < 0:
            raise InputError("link", "friction_nm_s", self.friction_nm_s, "a number >= 0 (friction dissipates)")
        if not self.inertia_kg_m2 > 0 or self.com_inertia_kg_m2 < -1e-12 * self.inertia_kg_m2:
            raise InputError(
                "link",
                "inertia_kg_m2",
                self.inertia_kg_m2,
                f"a number >= mass_kg * com_m^2 = {self.mass_kg * self.com_m**2:.6g} (it is about the joint axis; less"
                " makes the inertia matrix indefinite)",
            )

    @property
    def com_inertia_kg_m2(self) -> float:
        """Moment of inertia about the centre of mass, I - m r^2."""
        return self.inertia_kg_m2 - self.mass_kg * self.com_m**2

    def perturbed(self, mass_scale: float, com_scale: float) -> Link:
        """The link with mass and centre of mass scaled and its moment of inertia *about the centre of mass* unchanged.

        The moment of inertia about the joint axis follows by the parallel-axis theorem, ``I' = I - m r^2 + m' r'^2``.
        Keeping I itself instead would describe no rigid body: with the perturbation of Dehak 2022 (IV.5.1) the inertia
        matrix of the 3-DoF arm is then indefinite in almost every posture.
        """
        mass, com = self.mass_kg * mass_scale, self.com_m * com_scale
        inertia = self.com_inertia_kg_m2 + mass * com**2
        return Link(self.length_m, mass, com, inertia, self.friction_nm_s)


@dataclass(frozen=True)
class OperatingDomain:
    """The box of joint angles and speeds over which a design is stated to hold.

    Attributes:
        angle_rad: n intervals (lower, upper) of the joint angles.
        speed_rad_s: n intervals (lower, upper) of the joint speeds.
    """

    angle_rad: tuple[Interval, ...]
    speed_rad_s: tuple[Interval, ...]

    def __post_init__(self) -> None:
        """Refuse empty or non-finite intervals."""
        if len(self.angle_rad) != len(self.speed_rad_s):
            raise InputError("domain", "speed_rad_s", len(self.speed_rad_s), f"{len(self.angle_rad)} intervals")
        for field, intervals in (("angle_rad", self.angle_rad), ("speed_rad_s", self.speed_rad_s)):
            for joint, (low, high) in enumerate(intervals):
                if not (isfinite(low) and isfinite(high) and low <= high):
                    raise InputError("domain", f"{field}[{joint}]", (low, high), "finite lower <= upper")

    @classmethod
    def symmetric(cls, joints: int, angle_rad: float, speed_rad_s: float) -> OperatingDomain:
        """The box ``|theta_i| <= angle_rad``, ``|omega_i| <= speed_rad_s`` for every joint."""
        return cls(((-angle_rad, angle_rad),) * joints, ((-speed_rad_s, speed_rad_s),) * joints)

    @classmethod
    def around(
        cls, angle_rad: ArrayLike, speed_rad_s: ArrayLike, margin_rad: float = 0.1, speed_factor: float = 1.5
    ) -> OperatingDomain:
        """The box of a motion, widened.

        Args:
            angle_rad: joint angles at many times, times x n.
            speed_rad_s: joint speeds, likewise; the box of speeds is symmetric.
            margin_rad: added to both ends of every range of angles.
            speed_factor: multiplies the largest speed of every joint.
        """
        angle, fastest = np.asarray(angle_rad, dtype=float), np.abs(speed_rad_s).max(axis=0) * speed_factor
        low, high = angle.min(axis=0) - margin_rad, angle.max(axis=0) + margin_rad
        return cls(
            tuple((float(a), float(b)) for a, b in zip(low, high, strict=True)),
            tuple((-float(speed), float(speed)) for speed in fastest),
        )

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.angle_rad)

    def to_document(self) -> dict[str, Any]:
        """The ``domain`` member of an artifact."""
        return {
            "angle_rad": [list(interval) for interval in self.angle_rad],
            "speed_rad_s": [list(interval) for interval in self.speed_rad_s],
        }


@dataclass(frozen=True)
class ActuatorLimits:
    """What the actuators can deliver.

    Attributes:
        torque_nm: n largest torque magnitudes.
        slew_nm_per_s: n largest torque rates.
    """

    torque_nm: tuple[float, ...]
    slew_nm_per_s: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse limits that are not positive numbers."""
        if len(self.torque_nm) != len(self.slew_nm_per_s):
            raise InputError("limits", "slew_nm_per_s", len(self.slew_nm_per_s), f"{len(self.torque_nm)} numbers")
        for field, values in (("torque_nm", self.torque_nm), ("slew_nm_per_s", self.slew_nm_per_s)):
            for joint, value in enumerate(values):
                if not (isfinite(value) and value > 0):
                    raise InputError("limits", f"{field}[{joint}]", value, "a finite number > 0")

    def to_document(self) -> dict[str, Any]:
        """The ``limits`` member of an artifact."""
        return {"torque_nm": list(self.torque_nm), "slew_nm_per_s": list(self.slew_nm_per_s)}


@dataclass(frozen=True)
class PayloadSet:
    """The plants a robust design must cover: mass and centre of mass of each link between nominal and fully loaded.

    At fraction f in [0, 1] link i has mass ``m_i (1 + f (mass_scale_i - 1))`` and centre of mass
    ``r_i (1 + f (com_scale_i - 1))``; its moment of inertia about the centre of mass does not change. The moment of
    inertia about the joint axis is therefore a cubic polynomial of f.

    Attributes:
        mass_scale: n factors of the masses at f = 1.
        com_scale: n factors of the distances to the centres of mass at f = 1.
    """

    mass_scale: tuple[float, ...]
    com_scale: tuple[float, ...]

    def scales_at(self, fraction: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Factors (mass, centre of mass) at a payload fraction.

        Raises:
            InputError: the fraction is outside [0, 1].
        """
        if not 0.0 <= fraction <= 1.0:
            raise InputError("payloads", "fraction", fraction, "a number in [0, 1]")

        def at(scales: tuple[float, ...]) -> tuple[float, ...]:
            return tuple(1.0 + fraction * (scale - 1.0) for scale in scales)

        return at(self.mass_scale), at(self.com_scale)

    def to_document(self) -> dict[str, Any]:
        """The ``payloads`` member of an artifact."""
        return {
            "mass_scale": list(self.mass_scale),
            "com_scale": list(self.com_scale),
            "fraction": [0.0, 1.0],
            "inertia_about_com": "unchanged",
        }
