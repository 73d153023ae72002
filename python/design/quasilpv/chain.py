"""The chain as a program walks it: robot, design, release, verdicts, a run in closed loop.

What is here keeps its names and its meaning: `quasilpv.robot`, `quasilpv.design`, `quasilpv.verify`, `quasilpv.gate`
and `quasilpv.simulate` are these. Each takes what the one before it gives, artifacts also as files:

>>> import quasilpv as ql
>>> made = ql.design("arm2", law="pid", rate_hz=500)
>>> artifact = made.release()
>>> run = ql.simulate(artifact, "stabilise-arm2", plant="nominal")
>>> run.metrics.rms_x_m < 0.05
True
>>> figure = run.plot("torques")

Nothing is drawn, and no robot assumed, unless it is asked for: the robot of a run is that of the artifact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from flint import fmpq
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quasilpv import certificate
from quasilpv.arguments import checked
from quasilpv.artifact import Artifact, read_artifact
from quasilpv.certificate import Evidence, Gate, Verification
from quasilpv.documents.canonical import parse_document, parse_strict_json
from quasilpv.errors import InputError, one_of
from quasilpv.experiments.metrics import Metrics
from quasilpv.experiments.result import TrackResult
from quasilpv.experiments.run import Run
from quasilpv.experiments.setup import PlantKind, RunSetup
from quasilpv.experiments.track import robot_of, track
from quasilpv.figures.gallery import FIGURES, figures_of
from quasilpv.figures.gate import gate_figure
from quasilpv.figures.style import style
from quasilpv.figures.tracking import plot_error, plot_path, plot_torque
from quasilpv.files import read_bytes
from quasilpv.release import checked_artifact
from quasilpv.scenarios import (
    Sensors,
    SineTorque,
    TrackingExperiment,
    motions_of,
    tracking_experiment,
    tracking_experiments,
)
from quasilpv.shown import html_table
from quasilpv.synthesis import DEFAULT_CONTROLLER, DesignRequest, specification_for, synthesise
from quasilpv.synthesis.tracking_design import TrackingDesign
from quasilpv.systems.robots import registry
from quasilpv.systems.robots.registry import AnyRobot
from quasilpv.systems.robots.spatial_robot import SpatialRobot
from quasilpv.trajectories import SpatialPath, TaskPath, Trajectory, plan, plan_in_space

__all__ = ["Design", "GateResult", "Simulation", "design", "gate", "robot", "simulate", "verify"]

ArtifactLike: TypeAlias = Artifact | Path | str
"""An artifact, or a file that holds one, either twin."""

Reference: TypeAlias = str | Path | TaskPath | SpatialPath | Trajectory | TrackingExperiment
"""What a robot is to do: the id of a scenario, a path in task space, a trajectory, or a file of either."""

LINES = 6
"""Of numbers in a short description."""

MOST_DELAY_SAMPLES = 4.0
"""Of a gate, as for `quasilpv.synthesis.Specification`."""

robot = registry.any_robot

_ON_AXES: Mapping[str, Callable[[Axes, TrackResult], None]] = {
    "path": plot_path,
    "errors": plot_error,
    "torques": plot_torque,
}
"""The figures of a run that one plot can hold."""


@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """A law designed for a robot, not yet checked by anybody.

    Attributes:
        tracking: its gains, and what an independent checker needs.
    """

    tracking: TrackingDesign

    @property
    def robot(self) -> AnyRobot:
        """What it is for."""
        return self.tracking.robot

    @property
    def report(self) -> Mapping[str, Any]:
        """Numbers for people, JSON-able; empty for baselines."""
        return self.tracking.report

    def release(self, *, allow_unverified: bool = False) -> Artifact:
        """The artifact, its claims and its robust gate decided on the very numbers that are shipped.

        Args:
            allow_unverified: release a design whose claims do not hold, that fails its gate or whose limits cannot
                deliver what it needs; the artifact then says so.

        Raises:
            ClaimError: a claim does not hold or is not proved, the gate is not passed, or torque or slew limits cannot
                deliver what the design needs.
        """
        return checked_artifact(self.tracking, allow_unverified, motions_of)

    def __repr__(self) -> str:
        """Law, robot and rate, and the first numbers of the report."""
        rate = f"{1.0 / self.tracking.sample_period_s:g} Hz"
        numbers = {name: value for name, value in self.report.items() if isinstance(value, int | float)}
        lines = [f"  {name}: {value:.6g}" for name, value in list(numbers.items())[:LINES]]
        return "\n".join([f"Design({self.tracking.controller} for {self.robot.id}, {rate}, not yet released)", *lines])


@dataclass(frozen=True, eq=False, repr=False)
class GateResult:
    """What the robust gate found.

    Attributes:
        name: of the artifact.
        found: the verdict and what it rests on.
    """

    name: str
    found: Gate

    @property
    def passed(self) -> bool:
        """Whether the loop is stable in every posture, with every payload and every delay up to the specified one."""
        return self.found.passed

    @property
    def evidence(self) -> Evidence:
        """What the verdict rests on: a proof, or a grid."""
        return self.found.evidence

    @property
    def delay_margin_s(self) -> float | None:
        """The delay up to which it was found stable; None if it is not even without delay."""
        return self.found.delay_margin_s

    def to_document(self) -> dict[str, Any]:
        """JSON-able: what ``design robust --json`` prints."""
        return self.found.to_document()

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """The inertia margin, or the growth rates of the grid, over the delay; into the plot `ax` if there is one."""
        return gate_figure(self.found, ax)

    def _repr_html_(self) -> str:
        """The verdict as a table, for notebooks."""
        margin = "none" if self.delay_margin_s is None else f"{self.delay_margin_s:.4g}"
        rows = {"passed": self.passed, "rests on": self.evidence.value, "delay margin, s": margin}
        return html_table(f"gate of {self.name}", rows)

    def __repr__(self) -> str:
        """The verdict in a line."""
        margin = "none" if self.delay_margin_s is None else f"{1e3 * self.delay_margin_s:.4g} ms"
        word = "passed" if self.passed else "NOT passed"
        return f"GateResult({self.name}: {word}, {self.evidence.value}; delay margin {margin})"


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """A closed loop that was run.

    Attributes:
        result: the record, its numbers, and what its figures show.
    """

    result: TrackResult

    @property
    def metrics(self) -> Metrics:
        """The numbers."""
        return self.result.metrics

    @property
    def run(self) -> Run:
        """The record, sample by sample."""
        return self.result.run

    @property
    def figures(self) -> list[str]:
        """Names of the figures that `plot` draws of this run."""
        return figures_of(self.result)

    def plot(self, figure: str = "path", *, ax: Axes | None = None) -> Figure:
        """Draw one figure of the run.

        Args:
            figure: one of `figures`.
            ax: draw into this plot, which is the reader's own, instead of a figure of the common style; of ``path``,
                ``errors`` (the distance from the reference) and ``torques``.

        Returns:
            The figure; a notebook shows it.

        Raises:
            InputError: there is no such figure of this run, or it does not fit into one plot.
        """
        if figure not in self.figures:
            raise InputError(self.result.title, "figure", figure, one_of(self.figures, figure))
        if ax is None:
            return FIGURES[figure](self.result)
        if figure not in _ON_AXES:
            raise InputError(self.result.title, "ax", f"one plot for {figure}", f"one of {', '.join(_ON_AXES)}")
        with style():
            _ON_AXES[figure](ax, self.result)
        return ax.figure.figure

    def __repr__(self) -> str:
        """Scenario, controller, and the numbers of its row."""
        title = f"{self.result.title}, {self.result.plant} plant, {self.result.rate_hz:g} Hz"
        return "\n".join([f"Simulation({title})", *(f"  {name}: {value}" for name, value in self._numbers().items())])

    def _repr_html_(self) -> str:
        """The same as a table; no figure is drawn for it."""
        return html_table(self.result.title, self._numbers())

    def _numbers(self) -> dict[str, str]:
        metrics = self.metrics
        axes = {"X": metrics.rms_x_m, "Y": metrics.rms_y_m, "Z": metrics.rms_z_m}
        along = ", ".join(f"{1e3 * rms:.3g} in {axis}" for axis, rms in axes.items() if rms is not None)
        numbers = {
            "rms error of the tool": f"{1e3 * metrics.rms_tool_m:.3g} mm ({along})",
            "largest error": f"{1e3 * metrics.max_tool_m:.3g} mm",
            "torque": f"{metrics.rms_torque_nm:.3g} N m rms, {metrics.rms_torque_increment_nm:.3g} N m per sample",
            "at a limit": f"{100.0 * metrics.share_at_limit:.3g} % of the samples",
        }
        excess = metrics.largest_premise_excess
        return (
            numbers
            if excess is None
            else numbers | {"premises outside their box": f"by up to {excess:.3g} of its width"}
        )


@checked
def design(
    robot: AnyRobot | str,
    law: str = DEFAULT_CONTROLLER,
    *,
    rate_hz: float | None = None,
    encoder_bits: int | None = None,
    margin_spare: float | None = None,
    torque_activity: float | None = None,
    disturbance_compensation: bool = True,
) -> Design:
    """Design a law for a robot.

    >>> import quasilpv as ql
    >>> ql.design(ql.robot("arm3"), law="ctc", rate_hz=2000)
    Design(ctc for arm3, 2000 Hz, not yet released)

    Args:
        robot: a robot, or the name of one of the registry.
        law: one of ``quasilpv.synthesis.CONTROLLERS``.
        rate_hz: sample rate; by default that of the law.
        encoder_bits, margin_spare, torque_activity: see `quasilpv.synthesis.Specification`.
        disturbance_compensation: False to leave the observed disturbance out of the torque, to show what it is worth.

    Raises:
        InputError: an unknown robot or law, a number out of range, or a law that cannot do without compensation.
        InfeasibleError: no design meets the specification.
    """
    source = registry.any_robot(robot) if isinstance(robot, str) else robot
    wanted = specification_for(
        source,
        law,
        rate_hz=rate_hz,
        encoder_bits=encoder_bits,
        margin_spare=margin_spare,
        torque_activity=torque_activity,
    )
    return Design(synthesise(DesignRequest(source, law, wanted, disturbance_compensation)))


@checked
def verify(artifact: ArtifactLike) -> Verification:
    """Check every inequality an artifact claims, from the artifact alone.

    >>> import quasilpv as ql
    >>> ql.verify("missing.json")
    Traceback (most recent call last):
    quasilpv.errors.InputError: missing.json: file: got No such file or directory, expected a readable file

    Args:
        artifact: an artifact, or a file that holds one.

    Raises:
        InputError: the file holds none, or a law that claims nothing.
    """
    content, source = _content(artifact)
    return certificate.verify(content, source)


@checked
def gate(artifact: ArtifactLike, *, delay_samples: float | None = None) -> GateResult:
    """Ask whether the frozen loop of an artifact is stable in every posture, with every payload and small delay.

    >>> import quasilpv as ql
    >>> found = ql.gate(ql.design("arm2", rate_hz=1000).release())
    >>> found.passed, str(found.evidence)
    (True, 'enclosed')

    Args:
        artifact: an artifact, or a file that holds one.
        delay_samples: the transport delay it has to tolerate; half a sample by default.

    Raises:
        InputError: the file holds none, the law has no gate, or the delay is no number of samples from 0 to 4.
    """
    content, source = _content(artifact)
    if delay_samples is None:
        return GateResult(content["name"], certificate.gate(content, source))
    if not 0.0 <= delay_samples <= MOST_DELAY_SAMPLES:
        raise InputError("gate", "delay_samples", delay_samples, f"a number in [0, {MOST_DELAY_SAMPLES:g}]")
    exact = fmpq(*float(delay_samples).as_integer_ratio())
    return GateResult(content["name"], certificate.gate(content, source, exact))


@checked
def simulate(
    artifact: ArtifactLike,
    reference: Reference,
    *,
    plant: PlantKind = "perturbed",
    sensors: Sensors | None = None,
    external_torque: tuple[SineTorque, ...] | None = None,
    transport_delay_s: float = 0.0,
    robot: AnyRobot | None = None,
    folder: Path | str | None = None,
) -> Simulation:
    """Run a controller in closed loop: the C++ runtime against the simulated robot, in this process.

    >>> import quasilpv as ql
    >>> run = ql.simulate(ql.design("arm3", law="ctc").release(), "serial-square", plant="nominal")
    >>> run.metrics.rms_x_m < 0.1
    True

    Args:
        artifact: the controller, or a file that holds it.
        reference: what the robot is to do: the id of a scenario, a path in task space, a trajectory, or a file of
            either. A scenario brings its disturbance and its start with it.
        plant: ``"perturbed"``, the robot with its full payload, or ``"nominal"``.
        sensors: encoders and speed noise; 20 bits and 0.05 rad/s by default.
        external_torque: sines on the joints; by default those of the scenario, and none without one.
        transport_delay_s: from a sample to the moment its torque acts.
        robot: what the artifact was designed for, if the registry does not know it.
        folder: where the files of the run and its log are kept; by default nowhere.

    Raises:
        InputError: artifact, reference and robot do not fit, or something does not exist or cannot be written.
        PlantError: the plant could not be integrated.
    """
    if plant not in ("nominal", "perturbed"):
        raise InputError("simulate", "plant", plant, "nominal or perturbed")
    controller = artifact if isinstance(artifact, Artifact) else read_artifact(artifact)
    experiment = _experiment(controller, reference, robot, external_torque)

    def run(place: Path) -> Simulation:
        made = track(
            RunSetup(
                experiment,
                controller,
                plant=plant,
                sensors=sensors or Sensors(),
                transport_delay_s=transport_delay_s,
                log=folder is not None,
            ),
            place,
        )
        return Simulation(made)

    if folder is not None:
        return run(Path(folder))
    with TemporaryDirectory(prefix="quasilpv-") as place:
        return run(Path(place))


def _content(artifact: ArtifactLike) -> tuple[Mapping[str, Any], str]:
    """The document of an artifact, and what to call it in errors."""
    if isinstance(artifact, Artifact):
        return artifact.content(), artifact.name
    return read_artifact(artifact).content(), str(artifact)


def _experiment(
    artifact: Artifact, reference: Reference, source: AnyRobot | None, torque: tuple[SineTorque, ...] | None
) -> TrackingExperiment:
    """The experiment in which the robot of an artifact does what is asked for."""
    if isinstance(reference, TrackingExperiment):
        experiment = reference
    elif isinstance(reference, str) and reference in {one.name for one in tracking_experiments()}:
        experiment = tracking_experiment(reference)
    else:
        own = source or robot_of(artifact)
        trajectory = _trajectory(reference, own)
        return TrackingExperiment(trajectory.name, own, trajectory, torque or ())
    if torque is None:
        return experiment
    return replace(experiment, external_torque=torque)


def _trajectory(reference: str | Path | TaskPath | SpatialPath | Trajectory, robot: AnyRobot) -> Trajectory:
    """The reference in joint space: as it is, or planned for the robot."""
    if isinstance(reference, Trajectory):
        return reference
    if isinstance(reference, TaskPath | SpatialPath):
        if isinstance(robot, SpatialRobot) and isinstance(reference, SpatialPath):
            return plan_in_space(robot.tree, reference, robot.domain)
        if isinstance(robot, SpatialRobot) or isinstance(reference, SpatialPath):
            got, expected = f"a {type(reference).__name__}", "a TaskPath in the plane, a SpatialPath in space"
            raise InputError(reference.name, "path", f"{got} for {robot.id}", expected)
        return plan(robot.model, reference, robot.domain)
    source, path = str(reference), Path(reference)
    if isinstance(reference, str) and not path.suffix:
        known = [one.name for one in tracking_experiments()]
        raise InputError("simulate", "reference", reference, f"a file, or {one_of(known, reference)}")
    data = read_bytes(path)
    if path.suffix == ".cbor" or parse_strict_json(data, source).get("schema") == "quasilpv.trajectory":
        return Trajectory.from_document(parse_document(data, source), source)
    return TrackingExperiment.from_path_file(path, robot).trajectory
