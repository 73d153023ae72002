"""A run as what can be seen of it over time, and the clock that plays it: no browser, no wire, no wall clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self, TypeAlias

import numpy as np
import numpy.typing as npt

from quasilpv import _runtime
from quasilpv.arrays import FloatArray
from quasilpv.artifact import Artifact
from quasilpv.descriptions.meshes import BodyMesh
from quasilpv.documents.canonical import canonical_json
from quasilpv.errors import InputError
from quasilpv.experiments.disturbance import true_disturbance
from quasilpv.experiments.logged import logged_run
from quasilpv.systems.robots.drawing import Drawing
from quasilpv.systems.robots.tree_mechanism import TreeMechanism
from quasilpv.telemetry import RunLog
from quasilpv.telemetry.codes import STATES, word
from quasilpv.telemetry.message_types import Records

IntArray: TypeAlias = npt.NDArray[np.int64]

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0)


@dataclass(frozen=True, eq=False)
class Motion:
    """N samples of a run, one row each; joints in joint space, SI units.

    Attributes:
        time_s: (N,) since sample 0.
        reference_angle_rad: (N, n).
        angle_rad: (N, n) true angles where the truth is known, else the measured ones.
        torque_nm: (N, n) applied torque.
        estimate: (N, n) disturbance as the law compensates it; rad/s^2 for acceleration-level laws, N m for the others.
        disturbance: (N, n) the true one in the same unit; NaN where it is not known.
        weight: (N, p) of the upper vertex of each premise, ``(z - lower) / (upper - lower)``, in [0, 1].
        lyapunov_rad2: (N,) lower bound of the Lyapunov function; NaN where the controller has none.
        state: (N,) of the controller, index into `codes.STATES`.
        flags: (N,) fault bits; 0 is healthy.
        step_us: (N,) time of the control step; 0 where none was measured.
    """

    time_s: FloatArray
    reference_angle_rad: FloatArray
    angle_rad: FloatArray
    torque_nm: FloatArray
    estimate: FloatArray
    disturbance: FloatArray
    weight: FloatArray
    lyapunov_rad2: FloatArray
    state: IntArray
    flags: IntArray
    step_us: FloatArray

    @classmethod
    def of_telemetry(cls, records: Records, artifact: Artifact) -> Motion:
        """What telemetry alone tells, samples in order: measured angles, no true disturbance."""
        n, (lower, upper) = artifact.joints, artifact.law.premise_box
        span = np.subtract(upper, lower)
        return cls(
            time_s=records["seq"] * artifact.sample_period_s,
            reference_angle_rad=np.array(records["reference_angle_rad"][:, :n]),
            angle_rad=np.array(records["measured_angle_rad"][:, :n]),
            torque_nm=np.array(records["applied_torque_nm"][:, :n]),
            estimate=np.array(records["filtered_disturbance"][:, :n]),
            disturbance=np.full((records.size, n), np.nan),
            weight=(records["premise"][:, : len(lower)] - np.array(lower)) / span,
            lyapunov_rad2=np.array(records["lyapunov_rad2"]),
            state=records["state"].astype(np.int64),
            flags=records["flags"].astype(np.int64),
            step_us=1e-3 * records["step_ns"],
        )

    @classmethod
    def of_log(cls, log: RunLog) -> Motion:
        """A logged run, with the plant's true motion and disturbance if the log knows them.

        Raises:
            InputError: the log lacks the artifact, or holds no telemetry.
        """
        records = log["telemetry"].samples
        if not records.size:
            refused = ", ".join(f"{count} of {reason}" for reason, count in log["telemetry"].refused.items())
            raise InputError(log.source, "QLPV_TELEMETRY", refused or "no message", "the telemetry of a run")
        artifact = log.artifact
        motion = cls.of_telemetry(records, artifact)
        if not log["truth"].records.size:
            return motion
        run = logged_run(log)
        known = np.isin(records["seq"], log["truth"].samples["seq"])
        angle, disturbance = motion.angle_rad.copy(), motion.disturbance.copy()
        angle[known] = run.true_angle_rad
        runtime = _runtime.Artifact.parse(canonical_json(artifact.to_document()), log.source)
        true = true_disturbance(run, artifact, runtime)
        if true is not None:
            disturbance[known] = true.values
        return replace(motion, angle_rad=angle, disturbance=disturbance)

    @property
    def samples(self) -> int:
        """N."""
        return int(self.time_s.size)

    def sample_at(self, time_s: float) -> int:
        """Index of the last sample that is not later than a time; 0 before the first."""
        return max(int(np.searchsorted(self.time_s, time_s + 1e-9, side="right")) - 1, 0)


@dataclass(frozen=True, eq=False)
class Playback:
    """A motion and the robot that makes it.

    Attributes:
        title: of the run.
        motion: its samples, at least one.
        mechanism: whose links are drawn.
        disturbance_unit: of estimate and disturbance.
        source: name of the log, as others may have it; empty of a live run.
        meshes: of the bodies of a robot in space, drawn in place of its skeleton.
    """

    title: str
    motion: Motion
    mechanism: Drawing
    disturbance_unit: str
    source: str = ""
    meshes: tuple[BodyMesh, ...] = ()

    @property
    def begin_s(self) -> float:
        """Time of the first sample."""
        return float(self.motion.time_s[0])

    @property
    def end_s(self) -> float:
        """Time of the last sample."""
        return float(self.motion.time_s[-1])

    @property
    def step_us(self) -> FloatArray:
        """Time of every control step; 0 where none was measured."""
        return self.motion.step_us

    def sample_at(self, time_s: float) -> int:
        """Index of the last sample that is not later than a time; 0 before the first."""
        return self.motion.sample_at(time_s)

    @cached_property
    def tool_m(self) -> FloatArray:
        """(N, 2) or (N, 3), where the tool is."""
        return self.mechanism.tool_path(self.motion.angle_rad)

    @cached_property
    def reference_tool_m(self) -> FloatArray:
        """The same, where it should be."""
        return self.mechanism.tool_path(self.motion.reference_angle_rad)

    def at(self, time_s: float) -> Instant:
        """The state of the run at a time."""
        k = self.motion.sample_at(time_s)
        return Instant(
            sample=k,
            time_s=float(self.motion.time_s[k]),
            links_m=self.mechanism.skeleton(self.motion.angle_rad[k]),
            reference_links_m=self.mechanism.skeleton(self.motion.reference_angle_rad[k]),
            error_m=self.tool_m[k] - self.reference_tool_m[k],
            state=word(STATES, int(self.motion.state[k])),
            flags=int(self.motion.flags[k]),
            frames=self._frames(self.motion.angle_rad[k]),
        )

    def _frames(self, angle_rad: FloatArray) -> tuple[tuple[FloatArray, FloatArray], ...]:
        """Rotation and origin of the base's frame and of every joint's, if there is something to put there."""
        if not self.meshes or not isinstance(self.mechanism, TreeMechanism):
            return ()
        return ((np.eye(3), np.zeros(3)), *self.mechanism.tree.frames(angle_rad)[:-1])

    def with_motion(self, motion: Motion) -> Playback:
        """The same robot in another motion."""
        return replace(self, motion=motion)


@dataclass(frozen=True, eq=False)
class Instant:
    """What is drawn at one time.

    Attributes:
        sample: index into the motion.
        time_s: of that sample.
        links_m: (points, 2) or (points, 3), the robot's links as one line.
        reference_links_m: the same on the reference.
        error_m: (2,) or (3,) of the tool.
        state: of the controller, in words.
        flags: fault bits.
        frames: rotation and origin of base and joints, where meshes are drawn.
    """

    sample: int
    time_s: float
    links_m: FloatArray
    reference_links_m: FloatArray
    error_m: FloatArray
    state: str
    flags: int
    frames: tuple[tuple[FloatArray, FloatArray], ...] = ()


@dataclass
class Player:
    """The clock of a playback: it runs at a speed, stands, or is moved by hand.

    Attributes:
        begin_s, end_s: between which times it moves.
        time_s: now.
        speed: seconds of the run per second.
        playing: whether time passes.
    """

    begin_s: float
    end_s: float
    time_s: float
    speed: float = 1.0
    playing: bool = True

    @classmethod
    def of(cls, playback: Playback) -> Self:
        """A clock that starts to play at the beginning."""
        return cls(playback.begin_s, playback.end_s, playback.begin_s)

    def advance(self, elapsed_s: float) -> None:
        """Let time pass on the wall; the end of the run stops the clock."""
        if self.playing:
            self.seek(self.time_s + self.speed * elapsed_s)
            self.playing = self.time_s < self.end_s

    def seek(self, time_s: float) -> None:
        """Go to a time of the run."""
        self.time_s = min(max(time_s, self.begin_s), self.end_s)

    def toggle(self) -> None:
        """Stop or go on; at the end, begin again."""
        if not self.playing and self.time_s >= self.end_s:
            self.time_s = self.begin_s
        self.playing = not self.playing

    def follow(self, begin_s: float, end_s: float) -> None:
        """The run has grown: while playing, show its end."""
        self.begin_s, self.end_s = begin_s, end_s
        self.seek(end_s if self.playing else self.time_s)
