"""F11: how controllers start, against the bounds on motion and first torque; robots by laws by plants by starts.

The quick tier runs a fixed sample of the table; the whole of it is marked `full` and printed (``pytest -m full -s``).
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from quasilpv.arrays import FloatArray
from quasilpv.errors import ClaimError, InfeasibleError, PlantError
from quasilpv.experiments import designs
from quasilpv.experiments.start import Start, StartOutcome, joining_speed, start, undisturbed_speeds
from quasilpv.scenarios import Scenario, build_scenario, tracking_experiment
from quasilpv.synthesis import CONTROLLERS, DesignRequest, Specification
from quasilpv.systems.robots.registry import robot

STABILISING = ("pdc", "descriptor", "robust", "delayed")
TRACKING = tuple(name for name, kind in CONTROLLERS.items() if kind.function and name not in STABILISING)
TABLE = (
    *(("serial-square", name) for name in TRACKING if name != "dob-torque-premultiplied"),
    *(("fivebar-spiral", name) for name in TRACKING),
    *((scenario, name) for scenario in ("stabilise-arm2", "stabilise-arm2-upright") for name in ("pdc", "descriptor")),
    ("stabilise-arm2", "dob-acceleration"),
    ("stabilise-arm2", "delayed"),
    ("stabilise-arm3", "pdc"),
    ("stabilise-spring-disc", "robust"),
)
"""Scenario, which knows its robot, and controller."""
SHAKEN = "shaken"
"""The perturbed plant under the external torques of the experiment."""
QUICK = (
    ("serial-square", "dob-acceleration", "perturbed", tuple(Start)),
    ("serial-square", "pid", "perturbed", (Start.BESIDE, Start.RESTART)),
    ("serial-square", "ctc-dob", "nominal", (Start.RESET,)),
    ("fivebar-spiral", "ctc", "perturbed", (Start.BESIDE, Start.RESTART)),
    ("fivebar-spiral", "dob-acceleration", "shaken", (Start.RESET,)),
)
QUICK_S = 0.8
LINE = "{:24}{:26}{:11}{:20}{:>10}{:>10}{:>12}{:>12}"


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("designs")


@dataclass(frozen=True)
class Row:
    """One row of the table; the outcome is None where there is no such design, or where the run ended early."""

    scenario: str
    controller: str
    plant: str
    kind: Start
    outcome: StartOutcome | None
    why: str = ""
    ended: bool = False

    @property
    def is_bounded(self) -> bool:
        """Whether the bound is claimed: a controller that starts anew cannot know a torque from outside."""
        return not (self.plant == SHAKEN and self.kind is Start.RESTART)

    @property
    def holds(self) -> bool:
        """Whether it is within its bounds, or there is nothing to hold them."""
        return not self.ended if self.outcome is None else self.outcome.holds

    def __str__(self) -> str:
        if self.outcome is None:
            return LINE.format(self.scenario, self.controller, self.plant, self.kind, *"----") + f"  {self.why}"
        found = self.outcome
        fast = int(np.argmax(found.speed_rad_s - found.allowed_speed_rad_s))
        step = int(np.argmax(found.step_nm - found.allowed_step_nm))
        numbers = (found.speed_rad_s[fast], found.allowed_speed_rad_s[fast], found.step_nm[step])
        cells = [f"{number:.4g}" for number in (*numbers, found.allowed_step_nm[step])]
        return LINE.format(self.scenario, self.controller, self.plant, self.kind, *cells)


def rows(
    scenario: str,
    controller: str,
    plant: str,
    kinds: Sequence[Start],
    *,
    cache: Path,
    seconds: float | None = None,
) -> Iterator[Row]:
    """Design, start in each of these ways, and compare; with ``seconds`` the runs are cut to that time."""
    task = tracking_experiment(scenario)
    source = task.robot
    wanted = Specification(
        rate_hz=CONTROLLERS[controller].rate_hz, disturbance_frequency_rad_s=source.disturbance_frequency_rad_s
    )
    try:
        artifact = designs.kept_design(DesignRequest.of(source.id, controller, wanted), folder=cache)
    except (InfeasibleError, ClaimError) as error:
        yield from (Row(scenario, controller, plant, kind, None, str(error)) for kind in kinds)
        return
    trajectory = task.trajectory

    @functools.cache
    def of_experiment(in_motion: bool) -> tuple[Scenario, FloatArray]:
        experiment = build_scenario(
            source,
            trajectory,
            plant="nominal" if plant == "nominal" else "perturbed",
            external_torque=task.external_torque if plant == SHAKEN else (),
            initial_angle_rad=task.initial_angle_rad if in_motion else None,
            initial_speed_rad_s=task.initial_speed_rad_s if in_motion else None,
        )
        if seconds is not None:
            experiment = experiment.model_copy(update={"duration_s": seconds})
        return experiment, undisturbed_speeds(artifact, trajectory, experiment)

    for kind in kinds:
        in_motion = kind in (Start.RESTART, Start.RESET)  # a law that stabilises is at rest on its reference
        try:
            experiment, speeds = of_experiment(in_motion)
            yield Row(scenario, controller, plant, kind, start(artifact, trajectory, experiment, kind, speeds))
        except (ClaimError, PlantError) as error:
            yield Row(scenario, controller, plant, kind, None, str(error), ended=True)


@pytest.mark.parametrize(
    ("scenario", "controller", "plant", "kind"), [(*case[:3], kind) for case in QUICK for kind in case[3]]
)
def test_F11_robots_and_laws_start_gently_on_every_plant(
    scenario: str, controller: str, plant: str, kind: Start, cache: Path
) -> None:
    seconds = None if plant == SHAKEN else QUICK_S  # torques from outside begin later
    [found] = rows(scenario, controller, plant, [kind], cache=cache, seconds=seconds)
    assert found.outcome is not None
    assert found.outcome.holds, str(found)


@pytest.mark.full
@pytest.mark.parametrize(("scenario", "controller"), TABLE)
def test_F11_the_whole_table_of_starts_is_within_its_bounds(scenario: str, controller: str, cache: Path) -> None:
    print(LINE.format("scenario", "controller", "plant", "start", "rad/s", "allowed", "step N m", "allowed"))
    shaken = (SHAKEN,) if tracking_experiment(scenario).external_torque else ()
    beyond = []
    for plant in ("nominal", "perturbed", *shaken):
        for found in rows(scenario, controller, plant, tuple(Start), cache=cache):
            print(found, flush=True)
            if found.is_bounded and not found.holds:
                beyond.append(str(found))
    assert not beyond, "\n".join(beyond)


@pytest.mark.parametrize(
    ("speed", "allowed", "holds"),
    [
        ((0.0, 0.0), (0.0, 0.0), True),
        ((0.0, 1.0), (0.0, 1.0), True),
        ((1e-9, 0.0), (0.0, 1.0), False),
        ((0.5, 1.1), (1.0, 1.0), False),
    ],
)
def test_a_start_at_rest_is_within_a_bound_of_zero_and_nothing_else_is(
    speed: tuple[float, ...], allowed: tuple[float, ...], holds: bool
) -> None:
    of_speed = StartOutcome(np.array(speed), np.array(allowed), np.zeros(2), np.ones(2))
    of_torque = StartOutcome(np.zeros(2), np.ones(2), np.array(speed), np.array(allowed))
    assert of_speed.holds is of_torque.holds is holds


def test_the_speed_of_joining_is_that_of_the_quintic_whatever_the_start(cache: Path) -> None:
    source = robot("arm3")
    artifact = designs.kept_design(DesignRequest.of("arm3", "pid", Specification()), folder=cache)
    fastest = np.abs(artifact.domain.speed_rad_s).max(axis=1)
    beside = joining_speed(artifact, np.array([0.1, 0.0, 0.0]), np.zeros(3))
    assert beside[1] == beside[2] == 0.0
    assert 0.0 < beside[0] <= 0.25 * fastest[0] * (1 + 1e-9)
    assert source.domain.speed_rad_s[0][1] == fastest[0]
    falling = joining_speed(artifact, np.zeros(3), np.array([0.0, -0.7, 0.0]))
    np.testing.assert_allclose(falling, [0.0, 0.7, 0.0], rtol=1e-12)
