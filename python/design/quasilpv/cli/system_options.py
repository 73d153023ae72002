"""Options of a run of a general system, which ``simulate`` and ``hil`` share, and the experiment they ask for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from quasilpv.cli.console import print_json, print_note, print_table, progress
from quasilpv.cli.systems import numbers_by_name
from quasilpv.errors import InputError
from quasilpv.files import claim_folder

if TYPE_CHECKING:
    from quasilpv.documents.system_artifact import SystemArtifactDocument
    from quasilpv.experiments.system_run import SystemExperiment, SystemRun

ARTIFACT_SUFFIXES = (".json", ".cbor")

StartOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--start", metavar="NAME=VALUE", help="A state at t = 0; may be repeated.  [default: its trim]"),
]
ParameterOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--parameter", metavar="NAME=VALUE", help="True value of a parameter.  [default: middle of its interval]"
    ),
]
DurationOption: TypeAlias = Annotated[
    float | None, typer.Option("--duration", help="Length of the run, s.  [default: six times 1 / decay rate]")
]
DelayOption: TypeAlias = Annotated[
    float | None, typer.Option("--delay", help="Until an input acts, s; at most one sample.  [default: 0]")
]
Rk4Option: TypeAlias = Annotated[
    int | None,
    typer.Option("--rk4", min=0, max=1000, help="Runge-Kutta steps per sample; 0 for SUNDIALS IDA.  [default: 0]"),
]
NoiseOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--noise", metavar="NAME=VALUE", help="Standard deviation of white noise on what is measured of a state."
    ),
]
QuantisationOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--quantisation", metavar="NAME=VALUE", help="Step to which what is measured of a state is rounded."),
]
SeedOption: TypeAlias = Annotated[
    int | None, typer.Option("--seed", min=0, help="Of the noise; equal seeds give equal runs.")
]

DisturbanceOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--disturbance",
        metavar="NAME=FORM",
        help="Added to an input, or to the rate of a state: 0.5, step:0.5,FROM[,TO], sine:0.5,RAD/S[,RAD], noise:0.5.",
    ),
]


@dataclass(frozen=True)
class SystemOptions:
    """What the command line says of a run; None where it says nothing."""

    start: Sequence[str] | None
    parameter: Sequence[str] | None
    duration_s: float | None
    delay_s: float | None
    rk4_steps: int | None
    noise: Sequence[str] | None
    quantisation: Sequence[str] | None
    seed: int | None
    disturbance: Sequence[str] | None

    def given(self) -> list[str]:
        """The names of the options that were given."""
        named = {
            "--start": self.start,
            "--parameter": self.parameter,
            "--duration": self.duration_s,
            "--delay": self.delay_s,
            "--rk4": self.rk4_steps,
            "--noise": self.noise,
            "--quantisation": self.quantisation,
            "--seed": self.seed,
            "--disturbance": self.disturbance,
        }
        return [name for name, value in named.items() if value is not None and value != []]

    def experiment(self) -> SystemExperiment:
        """What is asked for.

        Raises:
            InputError: not of the form NAME=VALUE, a name twice, or a seed that cannot be kept.
        """
        from quasilpv.cli.disturbances import disturbances_of
        from quasilpv.experiments.system_run import SystemExperiment

        seed = {} if self.seed is None else {"seed": self.seed}
        return SystemExperiment(
            numbers_by_name("--start", self.start),
            numbers_by_name("--parameter", self.parameter),
            self.duration_s,
            self.delay_s or 0.0,
            self.rk4_steps or 0,
            noise=numbers_by_name("--noise", self.noise),
            quantisation=numbers_by_name("--quantisation", self.quantisation),
            disturbances=disturbances_of(self.disturbance, self.seed),
            **seed,
        )


def refuse(options: Sequence[str], expected: str) -> None:
    """Raise InputError for the first of options that were given, if there is one."""
    for name in options:
        raise InputError("command line", name, "a value", expected)


def artifact_of_system(path: Path, robots: str) -> SystemArtifactDocument:
    """The controller in a file.

    Args:
        path: of either twin.
        robots: what is there for robots instead.

    Raises:
        InputError: it is none, or one of a robot.
    """
    from quasilpv.artifact.system_store import read_system_artifact

    read = read_system_artifact(path)
    if read is None:
        raise InputError(str(path), "schema", "a controller of a robot", f"one of a system; robots: {robots}")
    return read


def rows_of(run: SystemRun) -> list[tuple[str, str]]:
    """A run for people, as the rows of a table."""
    from quasilpv.experiments.system_run import gain_of

    answer: dict[str, Any] = run.to_document()
    states = ", ".join(f"{name} {value:.4g}" for name, value in answer["final_state"].items())
    inputs = ", ".join(f"{name} {value:.4g}" for name, value in answer["largest_input"].items())
    rows = [
        ("samples", f"{answer['samples']}, {answer['duration_s']:.6g} s"),
        ("V", f"{answer['level_at_start']:.4g} at the start, {answer['final_level']:.4g} at the end"),
        ("largest V", f"{answer['largest_level']:.4g}"),
        ("final state", states),
        ("largest input", inputs),
        *_errors(answer),
        ("flags", ", ".join(answer["flags"]) or "none"),
    ]
    gain = gain_of(run)
    if gain is not None and run.artifact.l2_gain is not None:
        certified, energy = run.artifact.l2_gain
        rows.append(
            ("gain", f"{gain[0]:.4g} with energy {gain[1]:.4g} s; at most {certified:.4g} up to {energy:.4g} s")
        )
    if run.exit is not None:
        rows.append(("left its domain", f"{run.exit[1]} at {run.exit[0]:.6g} s"))
    return rows


def _errors(answer: dict[str, Any]) -> list[tuple[str, str]]:
    if "largest_error" not in answer:
        return []
    largest, final = (
        ", ".join(f"{name} {value:.4g}" for name, value in answer[member].items())
        for member in ("largest_error", "final_error")
    )
    return [("estimation error", f"at most {largest}; at the end {final}")]


def notes_of(run: SystemRun) -> list[str]:
    """What has to be said of a run besides its numbers."""
    notes = []
    if run.level[0] > 1.0:
        notes.append("the start is outside the region: nothing is proved of this run")
    elif run.start_level > 1.0:
        notes.append("the estimates start too far from the state: nothing is proved of this run")
    for name, assumed in run.beyond_assumed.items():
        value = run.scenario.parameters[name]
        notes.append(f"the proof assumes {name} in {assumed}: this run with {value:g} is beside it")
    if run.scenario.delay_s:
        notes.append(f"the proof is without delay: this run with {run.scenario.delay_s:g} s is beside it")
    if run.scenario.disturbances:
        notes.append("the region is proved without disturbance: this run with one is beside it")
    if not run.scenario.has_exact_sensors:
        notes.append("the proof assumes exact measurements: this run with noise or quantisation is beside it")
    return notes


def code_of(run: SystemRun) -> int:
    """Exit code 1 if a run that began inside its region did not stay."""
    return 0 if run.stayed or run.start_level > 1.0 else 1


def animate_system(
    path: Path, options: SystemOptions, *, out: Path, formats: Sequence[str], log: bool, json: bool
) -> int:
    """Run a system and write its phase portraits in motion, its figures and its log.

    Returns:
        As `code_of`.

    Raises:
        InputError: an option or the artifact is wrong, or a file cannot be written.
        PlantError: the equations could not be integrated.
    """
    from quasilpv.experiments.system_logged import write_log
    from quasilpv.experiments.system_run import simulate
    from quasilpv.figures.phase import write_phase_animation
    from quasilpv.figures.systems import draw_system_run
    from quasilpv.telemetry import LOG_NAME

    artifact = artifact_of_system(path, "design animate SCENARIO")
    folder = out / folder_name(artifact)
    claim_folder(folder)
    run = simulate(artifact, options.experiment(), str(path))
    animation = folder / "phase.gif"
    with progress(1) as steps:
        steps.begin(f"{artifact.name}: phase portraits")
        frames, speed = write_phase_animation(run, animation, steps.parts)
        steps.end()
    written = [animation, *(draw_system_run(run, folder, formats) if formats else [])]
    if log:
        written.append(write_log(folder / LOG_NAME, run))
    if json:
        print_json({**run.to_document(), "animation": str(animation), "frames": frames, "seconds_per_second": speed})
    else:
        print_table(artifact.name, ("", ""), [*rows_of(run), ("animation", f"{speed:.3g} s of the run per second")], 2)
    for note in [*notes_of(run), *(f"wrote {each}" for each in written)]:
        print_note(note)
    return code_of(run)


def folder_name(artifact: SystemArtifactDocument) -> str:
    """What a folder of its runs is called."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", artifact.name)
