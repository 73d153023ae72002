"""Baselines for robots in space, tuned as `dob-acceleration` is: PD and PID with gravity, computed torque, observer.

With torques ``D (kp e + ...)``, D a positive definite matrix, the frozen loops of all joints decouple into scalar ones,
``theta'' = a / rho`` with rho the eigenvalues of ``D^-1 M_t``, as those of the default law do. So each baseline is
searched for on scalar loops over the range of rho: of computed torque, ``D = s M(empty)``, the bounds that the default
law is designed with; of PD and PID, D diagonal, each joint's the geometric mean of the least and the largest inertia
it drives, which makes the range narrow; a range from random postures.

Constraints and effort are those of `quasilpv.synthesis.baselines.tuned`; torque activity is a share of each joint's
limit, from the noise of encoders and of measured speeds. The objective counts slow disturbances too, and counts them
more: see `SLOPE`. The gravity torque is that of the default law. Integrals rest by `quasilpv.synthesis.rest`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.certificate.laws.ctc import CtcDobLaw, CtcLaw
from quasilpv.certificate.laws.pid import PidLaw
from quasilpv.errors import InfeasibleError
from quasilpv.loops.loop_grid import LoopGrid
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.acceleration.tree_law import POSTURES, SEED, design_inertia, largest_row
from quasilpv.synthesis.baselines.tuned import COMPUTED_TORQUE, WITH_OBSERVER, computed_torque_law
from quasilpv.synthesis.baselines.tuning_search import LARGEST, Axes, Candidate, TuningSearch
from quasilpv.synthesis.chain_range import find_range
from quasilpv.synthesis.plant_grid import PlantGrid
from quasilpv.synthesis.rest import dead_zone_members
from quasilpv.synthesis.specification import VELOCITY_NOISE_RAD_S, Specification
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots.spatial_robot import SpatialRobot

RATIOS = 5
"""Scalar loops, geometrically spaced over the range."""

FREQUENCIES = (0.05, 0.25, 1.0)
"""Disturbances that are rejected, parts of the fastest: gravity and friction of a slow motion are among them."""

SLOPE = 0.7
"""Amplitudes of disturbances are taken to fall with the frequency to this power: between bounded amplitudes (0) and
bounded rates (1). Chosen in favour of the baselines, by their errors on ``ur5-square``: with 0 PID is left without
integral action, with 1 computed torque is slower."""

LARGEST_IN_SPACE = {
    **LARGEST,
    "bandwidth": 3.0,
    "filter_time": 100.0,
    "inertia_scale": 10.0,
}
"""Where the descent ends, in the units of the axes. Fast poles on a small design inertia are overdamped ones."""

PROPORTIONAL: Axes = {
    "bandwidth": tuple(float(w) for w in np.geomspace(0.005, 0.2, 10)),
    "filter_time": (0.5, 1.5, 4.0, 12.0),
    "inertia_scale": tuple(float(s) for s in np.geomspace(0.3, 4.0, 5)),
}
AXES: Mapping[str, Axes] = {
    "pd-tuned": PROPORTIONAL,
    "pid-tuned": {"integral_ratio": (0.01, 0.1, 0.3, 1.0), **PROPORTIONAL},
    "ctc-tuned": COMPUTED_TORQUE,
    "ctc-dob-tuned": WITH_OBSERVER,
}
"""Coarse grids, as those of `quasilpv.synthesis.baselines.tuned`."""


@dataclass(eq=False)
class TreeTuningSearch(TuningSearch):
    """A search on scalar loops; torque increments are shares of a joint's limit.

    Attributes:
        row: what an acceleration of one unit asks of the joint that has the least torque for it, as such a share.
    """

    row: float = 1.0

    @property
    def activity_bound_nm(self) -> float:
        """Largest admissible rms torque increment, as a share."""
        return self.specification.torque_activity

    def disturbance_gain(self, loops: LoopGrid, plants: PlantGrid) -> float:
        """Worst over the plants and `FREQUENCIES`, s^2: alone the fastest would not ask for any stiffness."""
        unit = np.asarray(np.linalg.cholesky(plants.nominal), dtype=np.float64)
        fastest = self.specification.disturbance_frequency_rad_s
        return max(float(loops.disturbance_gain(fastest * part, unit) / part**SLOPE) for part in FREQUENCIES)

    def torque_increment(self, loops: LoopGrid) -> float:
        """Worst over the plants, as a share."""
        return self.row * loops.torque_activity([self.specification.angle_noise_rad, VELOCITY_NOISE_RAD_S])


def pd_gravity_tuned(
    robot: SpatialRobot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """PD with gravity. InfeasibleError: no point of the search meets the specification."""
    return _joint_by_joint("pd-tuned", robot, specification, progress)


def pid_gravity_tuned(
    robot: SpatialRobot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """PID with gravity. InfeasibleError: no point of the search meets the specification."""
    return _joint_by_joint("pid-tuned", robot, specification, progress)


def computed_torque_tuned(
    robot: SpatialRobot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """Computed torque. InfeasibleError: no point of the search meets the specification, or no bounds were found."""
    return _computed_torque("ctc-tuned", robot, specification, progress)


def computed_torque_with_observer_tuned(
    robot: SpatialRobot, specification: Specification, progress: Progress = no_progress
) -> TrackingDesign:
    """The same with a disturbance observer."""
    return _computed_torque("ctc-dob-tuned", robot, specification, progress)


def _joint_by_joint(
    controller: str, robot: SpatialRobot, specification: Specification, progress: Progress
) -> TrackingDesign:
    driven, lowest, highest = _driven_inertia(robot)
    row = float((driven / np.array(robot.limits.torque_nm)).max())
    best = _best(controller, robot, specification, progress, (lowest, highest, row))
    gains = zip(("kp", "kd", "ki"), best.tuning.unit_gains(), strict=True)
    per_joint = best.tuning.inertia_scale * driven
    law = {
        "kind": PidLaw.tag(),
        **{name: (gain * per_joint).tolist() for name, gain in gains},
        "velocity_filter_time_constant_s": best.tuning.velocity_filter_time_constant_s,
        **_rest(robot, specification, best),
        **design_inertia(robot, 1.0),
    }
    return _designed(controller, robot, specification, law, best)


def _computed_torque(
    controller: str, robot: SpatialRobot, specification: Specification, progress: Progress
) -> TrackingDesign:
    found = find_range(robot, robot.tree)
    bounds = found.lowest.bound, found.highest.bound, largest_row(robot)
    best = _best(controller, robot, specification, progress, bounds)
    observer = best.tuning.observer_bandwidth_rad_s
    gains = zip(("gp", "gd", "gi"), best.tuning.unit_gains(), strict=True)
    law = {
        "kind": (CtcDobLaw if observer > 0.0 else CtcLaw).tag(),
        **{name: [gain] * robot.tree.order for name, gain in gains},
        "velocity_filter_time_constant_s": best.tuning.velocity_filter_time_constant_s,
        "disturbance_observer_bandwidth_rad_s": observer,
        **_rest(robot, specification, best),
        **design_inertia(robot, best.tuning.inertia_scale),
    }
    return _designed(controller, robot, specification, law, best)


def _rest(robot: SpatialRobot, specification: Specification, best: Candidate) -> dict[str, list[float]]:
    """The rule of rest of a law that integrates."""
    return dead_zone_members(robot, specification) if best.tuning.unit_gains()[2] > 0.0 else {}


def _best(
    controller: str,
    robot: SpatialRobot,
    specification: Specification,
    progress: Progress,
    bounds: tuple[float, float, float],
) -> Candidate:
    lowest, highest, row = bounds
    axes = AXES[controller]
    ratios = np.geomspace(lowest, highest, RATIOS)[:, None, None]
    plants = PlantGrid(np.zeros((RATIOS, 1)), np.ones((RATIOS, 1, 1)), {1.0: ratios})
    search = TreeTuningSearch(
        robot, specification, computed_torque_law, axes, plants, progress, LARGEST_IN_SPACE, row=row
    )
    found = search.run()
    if not found:
        about = f"{robot.id}: no {controller} design at {specification.rate_hz:g} Hz"
        raise InfeasibleError(
            f"{about}: no point of the search is stable with every payload within the torque activity"
        )
    return found[0]


def _driven_inertia(robot: SpatialRobot) -> tuple[FloatArray, float, float]:
    """The diagonal D, and the range of ``D^-1 M_t`` over random postures and all loads."""
    rng = np.random.default_rng(SEED)
    low, high = np.array(robot.domain.angle_rad).T
    postures = rng.uniform(low, high, (POSTURES, len(low)))
    light = robot.lightest().inertia(postures)
    loaded = np.array([heavy.inertia(postures) for heavy in robot.heaviest()])
    least, most = np.einsum("kii->ki", light).min(axis=0), np.einsum("lkii->lki", loaded).max(axis=(0, 1))
    driven = np.sqrt(least * most)
    unit = np.diag(driven**-0.5)
    below = np.linalg.eigvalsh(unit @ light @ unit)[:, 0].min()
    above = np.linalg.eigvalsh(unit @ loaded @ unit)[..., -1].max()
    return driven, float(below), float(above)


def _designed(
    controller: str, robot: SpatialRobot, specification: Specification, law: dict[str, Any], best: Candidate
) -> TrackingDesign:
    return TrackingDesign(
        controller=controller,
        robot=robot,
        sample_period_s=specification.sample_period_s,
        law=law,
        expressions={},
        inputs={"controller": controller, "specification": specification.to_document()},
        report={
            **asdict(best.tuning),
            "disturbance_gain_s2": best.disturbance_gain,
            "predicted_torque_activity": best.torque_increment_nm,
        },
    )
