"""How a controller starts, in virtual time: on its reference, beside it, anew while the arm moves, out of a fault.

The controller is the control loop of the executables as it runs in real time, the plant a scenario's; only time is
virtual, so that equal arguments give equal runs. Two things are asked of a start. **Motion**: no joint is faster than
1.5 times its largest speed in the undisturbed run plus that of the segment that joins the reference. **Torque**: the
first torque differs from the torque in force by no more than the law's own first torque does, plus 5 % of the limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import ClaimError
from quasilpv.scenarios import Scenario
from quasilpv.trajectories import Trajectory

SPEED_FACTOR = 1.5
TORQUE_SHARE = 0.05
BESIDE_RAD = 0.1
INTERRUPTION_S = 0.005
"""So long the plant holds the last torque of a controller that is no more."""
FOREIGN_MESSAGES = 100
"""So many in a row latch a fault."""


class Start(StrEnum):
    """The ways to start."""

    ON = "on the reference"
    BESIDE = "at rest beside it"
    RESTART = "restart in motion"
    RESET = "reset in motion"


@dataclass(frozen=True, eq=False)
class StartOutcome:
    """What a start showed, per joint.

    Attributes:
        speed_rad_s: largest speed from the start on, (n,).
        allowed_speed_rad_s: what it may be, (n,).
        step_nm: the first torque minus the torque in force, magnitudes, (n,).
        allowed_step_nm: what it may be, (n,).
    """

    speed_rad_s: FloatArray
    allowed_speed_rad_s: FloatArray
    step_nm: FloatArray
    allowed_step_nm: FloatArray

    @property
    def speed_ratio(self) -> float:
        """Of the joint that comes nearest to what it may."""
        return _largest_share(self.speed_rad_s, self.allowed_speed_rad_s)

    @property
    def step_ratio(self) -> float:
        """Likewise."""
        return _largest_share(self.step_nm, self.allowed_step_nm)

    @property
    def holds(self) -> bool:
        """Whether motion and torque are within their bounds."""
        return self.speed_ratio <= 1.0 and self.step_ratio <= 1.0


@dataclass(eq=False)
class _Run:
    """A plant and what has been seen of it."""

    artifact: Artifact
    runtime: _runtime.Artifact
    trajectory: _runtime.Trajectory
    session: _runtime.PlantSession
    torque: FloatArray

    @classmethod
    def of(cls, artifact: Artifact, trajectory: Trajectory, scenario: Scenario) -> _Run:
        return cls(
            artifact,
            _runtime.Artifact.parse(canonical_json(artifact.to_document()), artifact.name),
            _runtime.Trajectory.parse(canonical_json(trajectory.to_document()), trajectory.name),
            _runtime.PlantSession(
                _runtime.Scenario.parse(canonical_json(scenario.to_document()), scenario.name),
                artifact.sample_period_s,
            ),
            np.zeros(artifact.joints),
        )

    def loop(self, bumpless: bool = True) -> _runtime.ControlLoop:
        return _runtime.ControlLoop(self.runtime, self.trajectory, bumpless)

    def controlled(self, loop: _runtime.ControlLoop) -> FloatArray:
        """The command of a loop for the present sample."""
        loop.handle(self.session.seq, *self.session.measure())
        return loop.torque

    def advance(self, torque: FloatArray) -> None:
        """The next sample under a torque."""
        self.torque = torque
        self.session.advance(torque)

    def follow(self, loop: _runtime.ControlLoop, until: int) -> FloatArray:
        """Under a loop to a sample; the speeds from here to there, magnitudes, (samples + 1, n)."""
        speeds = [np.abs(self.session.speed)]
        while self.session.seq < until:
            self.advance(self.controlled(loop))
            speeds.append(np.abs(self.session.speed))
        return np.array(speeds)

    def own_torque(self) -> FloatArray:
        """What the law begins with where the arm is, without an error: at rest, with the reference's acceleration."""
        n, seq = self.artifact.joints, self.session.seq
        angle, _ = self.session.measure()
        _, _, acceleration = self.trajectory.evaluate(seq * self.artifact.sample_period_s)
        law = _runtime.Controller(self.runtime)
        return law.step(angle, angle, np.zeros(n), acceleration, np.zeros(n)).torque_applied[:n]


def undisturbed_speeds(artifact: Artifact, trajectory: Trajectory, scenario: Scenario) -> FloatArray:
    """Speeds of the run that nothing interrupts, magnitudes, (samples + 1, n).

    Args:
        artifact: the controller.
        trajectory: the reference.
        scenario: the plant and its disturbances; begun half an encoder step from where it says.
    """
    run = _Run.of(artifact, trajectory, _at_an_edge(scenario))
    return run.follow(run.loop(bumpless=False), run.session.samples)


def start(
    artifact: Artifact, trajectory: Trajectory, scenario: Scenario, kind: Start, speeds: FloatArray
) -> StartOutcome:
    """Start a controller and compare its motion with that of the undisturbed run.

    Args:
        artifact: the controller.
        trajectory: the reference.
        scenario: the plant and how it begins; `Start.BESIDE` moves it. Its disturbances are those of both runs.
        kind: of start. A restart or a fault interrupts the run when the undisturbed one is fastest.
        speeds: of the undisturbed run, from `undisturbed_speeds`: one serves all kinds.

    Raises:
        ClaimError: the controller does not start.
    """
    samples, usual = len(speeds) - 1, speeds.max(axis=0)
    if kind is Start.BESIDE:
        beside = {"angle_rad": tuple(np.array(scenario.initial.angle_rad) + _beside(artifact, scenario))}
        beside["speed_rad_s"] = (0.0,) * artifact.joints
        scenario = scenario.model_copy(update={"initial": scenario.initial.model_copy(update=beside)})
    run = _Run.of(artifact, trajectory, scenario)
    interrupted = _fastest(speeds, artifact)
    loop = run.loop()
    if kind is Start.RESTART:
        run.follow(run.loop(), interrupted)
        _interrupt(run)
    elif kind is Start.RESET:
        run.follow(loop, interrupted)
        _fault(run, loop)
    in_force, own = run.torque, run.own_torque()
    first = run.controlled(loop)
    if loop.refusal is not None:
        raise ClaimError(f"{artifact.name}: {kind}: {loop.refusal}")
    run.advance(first)
    joining = joining_speed(artifact, *_offset(run))
    speed = run.follow(loop, samples).max(axis=0)
    if loop.state == "fault":
        raise ClaimError(f"{artifact.name}: {kind}: {loop.cause}")
    return StartOutcome(
        speed_rad_s=speed,
        allowed_speed_rad_s=SPEED_FACTOR * usual + joining,
        step_nm=np.abs(first - in_force),
        allowed_step_nm=np.abs(own - in_force) + TORQUE_SHARE * np.array(artifact.limits.torque_nm),
    )


def _largest_share(found: FloatArray, allowed: FloatArray) -> float:
    """Of what is allowed, over the joints; where nothing is, nothing is all of it and anything too much."""
    without = np.where(found > 0.0, np.inf, 0.0)
    return float(np.max(np.divide(found, allowed, out=without, where=allowed > 0.0)))


def joining_speed(artifact: Artifact, offset: FloatArray, speed: FloatArray) -> FloatArray:
    """Largest speed of each joint relative to the reference while a start joins it, (n,).

    Solved for anew from what the segment is: the quintic from (offset, speed, 0) to rest at 0 in the stated duration.

    Args:
        artifact: the controller; its domain and limits decide how long joining takes.
        offset: of the arm from the reference, (n,), rad.
        speed: of that offset, (n,), rad/s.
    """
    inertia = artifact.inertia_table
    vertices = np.array([vertex for block in inertia.blocks for vertex in block.vertices])
    acceleration = np.min(np.array(artifact.limits.torque_nm) / np.abs(vertices).sum(axis=2).max(axis=0))
    fastest = np.abs(artifact.domain.speed_rad_s).max(axis=1)
    size, pace = np.abs(offset), np.abs(speed)
    duration = max(
        0.02,
        float(np.max(1.875 * size / (0.25 * fastest))),
        float(np.sqrt(np.max(10.0 / np.sqrt(3.0) * size) / (0.2 * acceleration))),
        float(np.max(3.94 * pace) / (0.3 * acceleration)),
    )
    powers = np.arange(6)
    end = duration**powers
    conditions = np.zeros((6, 6))
    conditions[0, 0], conditions[1, 1], conditions[2, 2] = 1.0, 1.0, 2.0
    conditions[3] = end
    conditions[4, 1:] = powers[1:] * end[:-1]
    conditions[5, 2:] = powers[2:] * powers[1:-1] * end[:-2]
    wanted = np.zeros((6, offset.size))
    wanted[0], wanted[1] = offset, speed
    coefficients = np.linalg.solve(conditions, wanted)
    time = np.linspace(0.0, duration, 1001)[:, None]
    rate = (powers[1:] * time ** (powers[1:] - 1)) @ coefficients[1:]
    return np.asarray(np.abs(rate).max(axis=0))


def _fastest(speeds: FloatArray, artifact: Artifact) -> int:
    """The sample with the largest share of a domain's speed, not so late that nothing follows nor before a start."""
    share = (speeds / np.abs(artifact.domain.speed_rad_s).max(axis=1)).max(axis=1)
    early, late = round(2 * INTERRUPTION_S / artifact.sample_period_s), round(0.9 * len(speeds))
    return early + int(np.argmax(share[early:late]))


def _beside(artifact: Artifact, scenario: Scenario) -> FloatArray:
    """0.1 rad to the side where there is more room in the operating domain, but not outside it."""
    low, high = np.array(artifact.domain.angle_rad).T
    angle = np.array(scenario.initial.angle_rad)
    upwards = high - angle >= angle - low
    room = 0.999 * np.where(upwards, high - angle, angle - low)
    return np.asarray(np.where(upwards, 1.0, -1.0) * np.minimum(BESIDE_RAD, room))


def _at_an_edge(scenario: Scenario) -> Scenario:
    """The same begun half an encoder step aside, where every encoder has just changed its reading.

    An arm at rest on a mark of its encoders is not seen to move and never moves. After every other start the law
    answers to the steps of its encoders, as in the undisturbed run of every arm that is somewhere between.
    """
    bits = scenario.sensors.encoder_bits
    if bits == 0:
        return scenario
    angle = tuple(a + 0.501 * 2.0 * np.pi / 2**bits for a in scenario.initial.angle_rad)
    return scenario.model_copy(update={"initial": scenario.initial.model_copy(update={"angle_rad": angle})})


def _offset(run: _Run) -> tuple[FloatArray, FloatArray]:
    """Where the arm is and how fast, relative to its reference."""
    angle, speed, _ = run.trajectory.evaluate(run.session.seq * run.artifact.sample_period_s)
    return run.session.angle - angle, run.session.speed - speed


def _interrupt(run: _Run) -> None:
    """No commands: the plant holds the last torque."""
    for _ in range(round(INTERRUPTION_S / run.artifact.sample_period_s)):
        run.advance(run.torque)


def _fault(run: _Run, loop: _runtime.ControlLoop) -> None:
    """A fault that is not the arm's, some way towards the safe torque, and the reset."""
    loop.handle(run.session.seq, *run.session.measure(), FOREIGN_MESSAGES)
    run.advance(loop.torque)
    for _ in range(round(INTERRUPTION_S / run.artifact.sample_period_s)):
        run.advance(run.controlled(loop))
    if loop.state != "fault" or not loop.reset_fault():
        raise ClaimError(f"{run.artifact.name}: the fault was not left: {loop.cause}")
