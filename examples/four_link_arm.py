"""A robot of your own, from its links to a tracked trajectory: a 4-link arm with a cranked tool.

The arm hangs in a vertical plane and works on a seam beside it. Its last link carries a tool that does not lie on the
link's axis but beside it, and the arm has one joint more than a tool with a position and an orientation needs. Both are
kinematics, so both are stated here; dynamics, premises, polytope, design, proof, simulation and figures follow from the
links. In absolute angles alpha_k, with the tool seen from the last joint at the distance l_4 under the angle delta,

    (X, Y) = sum_{k<4} L_k (sin alpha_k, -cos alpha_k) + l_4 (sin(alpha_4 + delta), -cos(alpha_4 + delta))
    Phi = alpha_4

The spare joint is used up by a fourth coordinate of the pose, theta_2 - theta_3, that is kept at zero: both elbows bend
alike (the extended Jacobian of Baillieul, 1985).

Run it: python examples/four_link_arm.py
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quasilpv.artifact import Artifact
from quasilpv.errors import InputError
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.figures.animation import write_animation
from quasilpv.figures.gallery import write_gallery
from quasilpv.release import checked_artifact
from quasilpv.scenarios import Sensors, TrackingExperiment, sine_torques
from quasilpv.synthesis import DesignRequest, synthesise, without_compensation
from quasilpv.systems.robots.arm_parameters import ActuatorLimits, Link, OperatingDomain, PayloadSet
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.registry import Robot
from quasilpv.trajectories import TaskPath, plan
from quasilpv.trajectories.paths import ArcSegment, LineSegment, Segment

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CrankedArm(PlanarSerialArm):
    """A 4-link arm whose tool lies ``crank_m`` beside the end of its last link, at right angles to it."""

    crank_m: float = 0.0

    @property
    def posture(self) -> tuple[float, ...]:
        """theta_2 - theta_3 = 0 on every path."""
        return (0.0,)

    @cached_property
    def _tool(self) -> tuple[float, float]:
        """Distance l_4 and angle delta of the tool, seen from the last joint."""
        length = self.links[-1].length_m
        return float(np.hypot(length, self.crank_m)), float(np.arctan2(self.crank_m, length))

    def _sides(self, theta: ArrayLike) -> tuple[Array, Array]:
        """Lengths and absolute angles of the lines from joint to joint, and from the last joint to the tool."""
        distance, angle = self._tool
        return np.array([*self.length_m[:-1], distance]), self.absolute(theta) + np.array([0.0, 0.0, 0.0, angle])

    def skeleton(self, theta: ArrayLike) -> Array:
        """Base, joints, end of the last link and tool, 6 x 2, m."""
        alpha = self.absolute(theta)[-1]
        crank = self.crank_m * np.array([np.cos(alpha), np.sin(alpha)])
        points = super().skeleton(theta)
        return np.vstack([points, points[-1] + crank])

    def forward_kinematics(self, theta: ArrayLike) -> Array:
        """(X, Y, Phi, theta_2 - theta_3)."""
        _, second, third, _ = np.asarray(theta, dtype=float)
        return np.array([*self.skeleton(theta)[-1], self.absolute(theta)[-1], second - third])

    def jacobian(self, theta: ArrayLike) -> Array:
        """Of the four coordinates of the pose, 4 x 4."""
        length, angle = self._sides(theta)
        across = length * np.array([np.cos(angle), np.sin(angle)])
        return np.vstack([np.cumsum(across[:, ::-1], axis=1)[:, ::-1], np.ones(4), [0.0, 1.0, -1.0, 0.0]])

    def jacobian_rate_times_speed(self, theta: ArrayLike, omega: ArrayLike) -> Array:
        """(dJ/dt) omega: the centripetal acceleration of the tool, and zeros."""
        length, angle = self._sides(theta)
        pull = length * self.absolute(omega) ** 2
        return np.array([-pull @ np.sin(angle), pull @ np.cos(angle), 0.0, 0.0])

    def inverse_kinematics(self, pose: ArrayLike) -> Array:
        """Joint angles for a pose with equal elbow angles q in (0, pi).

        With r the distance of joint 4 from the base, c = cos(q) solves

            4 L_1 L_3 c^2 + 2 L_2 (L_1 + L_3) c + (L_1 - L_3)^2 + L_2^2 - r^2 = 0

        Raises:
            InputError: no such angle: the tool is out of reach.
        """
        X, Y, Phi, _ = np.asarray(pose, dtype=float)
        L1, L2, L3, _ = self.length_m
        distance, angle = self._tool
        wrist_x, wrist_y = X - distance * np.sin(Phi + angle), Y + distance * np.cos(Phi + angle)
        half, constant = L2 * (L1 + L3), (L1 - L3) ** 2 + L2**2 - wrist_x**2 - wrist_y**2
        cosine = (np.sqrt(max(half**2 - 4 * L1 * L3 * constant, 0.0)) - half) / (4 * L1 * L3)
        if not abs(cosine) < 1.0:
            got = f"joint 4 at {np.hypot(wrist_x, wrist_y):.4g} m from the base"
            raise InputError(self.name, f"tool pose ({X:.4g} m, {Y:.4g} m, {Phi:.4g} rad)", got, "a place within reach")
        q = np.arccos(cosine)
        bent = np.arctan2(L2 * np.sin(q) + L3 * np.sin(2 * q), L1 + L2 * np.cos(q) + L3 * np.cos(2 * q))
        first = np.arctan2(wrist_x, -wrist_y) - bent
        return np.array([first, q, q, Phi - first - 2 * q])


ARM = CrankedArm(
    "four-link-arm",
    links=(
        Link(length_m=0.50, mass_kg=6.0, com_m=0.25, inertia_kg_m2=0.55),
        Link(length_m=0.40, mass_kg=4.0, com_m=0.20, inertia_kg_m2=0.24),
        Link(length_m=0.30, mass_kg=2.5, com_m=0.15, inertia_kg_m2=0.085),
        Link(length_m=0.15, mass_kg=1.5, com_m=0.08, inertia_kg_m2=0.016),
    ),
    crank_m=0.08,
)

SEAM = TaskPath(
    name="seam",
    tool_angle_rad=np.pi / 2,
    start=(0.75, -0.60),
    segments=(
        Segment(line=LineSegment(to=(0.85, -0.60), duration_s=0.8)),
        Segment(arc=ArcSegment(centre=(0.85, -0.55), angle_rad=np.pi, duration_s=1.2)),
        Segment(line=LineSegment(to=(0.75, -0.50), duration_s=0.8)),
    ),
)
"""Along one side of a plate, around its end, and back along the other side, the tool always horizontal."""


def robot() -> Robot:
    """The arm, and what is asked of it: its domain is the box of the seam, widened."""
    reference = plan(ARM, SEAM)
    return Robot(
        id=ARM.name,
        summary="planar serial arm, 4 joints, with a cranked tool",
        model=ARM,
        domain=OperatingDomain.around(*reference.evaluate(reference.knots_s)[:2]),
        limits=ActuatorLimits(torque_nm=(150.0, 80.0, 40.0, 15.0), slew_nm_per_s=(1e5, 1e5, 1e5, 1e5)),
        payloads=PayloadSet(mass_scale=(1.0, 1.0, 1.0, 2.0), com_scale=(1.0, 1.0, 1.0, 1.25)),
    )


def tracked(source: Robot, artifact: Artifact, folder: Path) -> TrackResult:
    """The seam in closed loop: C++ controller, arm with its full payload under IDA, 20-bit encoders, disturbance."""
    torque = sine_torques((30.0, 15.0), (20.0, 15.0), (10.0, 15.0), (3.0, 15.0))
    experiment = TrackingExperiment("seam", source, plan(ARM, SEAM, source.domain), torque)
    return track(RunSetup(experiment, artifact, plant="perturbed", sensors=Sensors()), folder)


def main(folder: Path = Path("out/four-link-arm")) -> None:
    """Design, and track with and without compensation of the disturbance; print and draw."""
    source = robot()
    results, design = [], synthesise(DesignRequest.of(source))
    for name, variant in (("without", without_compensation(design)), ("with", design)):
        artifact = checked_artifact(variant)  # refused unless its certificate and its robust gate hold
        result = tracked(source, artifact, folder / name)
        rms_um = 1e6 * np.array([result.metrics.rms_x_m, result.metrics.rms_y_m])
        print(f"{artifact.name}, {name} compensation: rms {rms_um[0]:.3g} um in X, {rms_um[1]:.3g} um in Y")
        results.append(result)
    write_gallery(results[1], folder)
    write_animation(results, folder / "animation.gif")


if __name__ == "__main__":
    main()
