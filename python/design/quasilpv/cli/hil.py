"""``design hil``: one scenario with controller and plant as two processes over LCM."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quasilpv.cli.console import JsonOption, print_json, print_table, progress
from quasilpv.cli.options import (
    ArtifactOption,
    EncoderOption,
    LogOption,
    RateOption,
    plant_kind,
    require_controller,
    sensors_of,
)
from quasilpv.cli.pacing import Pacing, print_ending, print_latencies
from quasilpv.cli.system_hil import run_system
from quasilpv.cli.system_options import (
    ARTIFACT_SUFFIXES,
    DelayOption,
    DisturbanceOption,
    DurationOption,
    NoiseOption,
    ParameterOption,
    QuantisationOption,
    Rk4Option,
    SeedOption,
    StartOption,
    SystemOptions,
    refuse,
)
from quasilpv.defaults import ENCODER_BITS, WATCHDOG_S
from quasilpv.errors import FaultStop, InputError
from quasilpv.synthesis import DEFAULT_CONTROLLER

if TYPE_CHECKING:
    from quasilpv.cli.session import Session
    from quasilpv.experiments.hil import HilResult
    from quasilpv.experiments.processes import Talk
    from quasilpv.experiments.result import TrackResult, Variant
    from quasilpv.scenarios import TrackingExperiment

WATCHDOG_DEFAULT = f"[default: {WATCHDOG_S:g}; of systems at least three samples]"


def hil_command(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="Scenario id, see design list, or ARTIFACT of a system.")
    ],
    *,
    real_time: Annotated[bool, typer.Option("--real-time", help="Paced by the clock instead of lock-step.")] = False,
    silence_s: Annotated[
        float | None,
        typer.Option(
            "--silence-s", min=1e-3, help=f"Real time: fault after so long without a measurement.  {WATCHDOG_DEFAULT}"
        ),
    ] = None,
    hold_s: Annotated[
        float | None,
        typer.Option(
            "--hold-s",
            min=1e-3,
            help=f"Real time: the plant brakes after so long without a command.  {WATCHDOG_DEFAULT}",
        ),
    ] = None,
    priority: Annotated[
        int | None, typer.Option("--priority", min=1, max=99, help="Real time: lock memory, use SCHED_FIFO.")
    ] = None,
    controller: Annotated[
        str | None, typer.Option("--controller", metavar="ID", help=f"[default: {DEFAULT_CONTROLLER}]")
    ] = None,
    artifact: ArtifactOption = None,
    rate_hz: RateOption = None,
    encoder_bits: EncoderOption = None,
    plant: Annotated[
        str | None, typer.Option("--plant", metavar="PLANT", help="nominal or perturbed.  [default: perturbed]")
    ] = None,
    start: StartOption = None,
    parameter: ParameterOption = None,
    duration_s: DurationOption = None,
    delay_s: DelayOption = None,
    rk4_steps: Rk4Option = None,
    noise: NoiseOption = None,
    quantisation: QuantisationOption = None,
    seed: SeedOption = None,
    disturbance: DisturbanceOption = None,
    url: Annotated[
        str | None,
        typer.Option("--url", help="LCM URL of both, so that others can listen.  [default: a port of its own]"),
    ] = None,
    key: Annotated[
        Path | None,
        typer.Option("--key", metavar="FILE", help="Both sign what they say with this secret."),
    ] = None,
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for run files, records and logs.")
    ] = Path("out/hil"),
    log: LogOption = True,
    json: JsonOption = False,
) -> int:
    """Run a scenario, or a system, with controller and plant as two processes over LCM, and once more in this process.

    In lock-step both runs must be identical, bit for bit (exit code 1 if they are not). With --real-time the rms of
    both is printed with the measured wake-up and round-trip latencies beside it. A run that a fault stopped is printed
    all the same, and ends with exit code 3.

    \b
    Examples:
      design hil serial-square --real-time
      design hil out/cart_pole/artifact.json --start th=0.2 --noise th=0.001
    """
    if priority is not None and not real_time:
        raise InputError("command line", "--priority", priority, "nothing without --real-time: lock-step has no clock")
    own = SystemOptions(start, parameter, duration_s, delay_s, rk4_steps, noise, quantisation, seed, disturbance)
    pace = Pacing(real_time, silence_s, hold_s, priority, url, key)
    if scenario.endswith(ARTIFACT_SUFFIXES):
        robots = {
            "--controller": controller,
            "--artifact": artifact,
            "--rate-hz": rate_hz,
            "--encoder-bits": encoder_bits,
            "--plant": plant,
        }
        refuse([name for name, value in robots.items() if value is not None], "nothing beside the artifact of a system")
        return run_system(Path(scenario), own, pace, out=out, log=log, json=json)
    refuse(own.given(), "nothing beside a scenario of a robot")
    _run_robot(
        scenario,
        Asked(controller or DEFAULT_CONTROLLER, artifact, rate_hz, encoder_bits, plant or "perturbed"),
        pace,
        out=out,
        log=log,
        json=json,
    )
    return 0


@dataclass(frozen=True)
class Asked:
    """Which controller a robot gets, and which plant."""

    controller: str
    artifact: Path | None
    rate_hz: float | None
    encoder_bits: int | None
    plant: str


def _run_robot(scenario: str, asked: Asked, pace: Pacing, *, out: Path, log: bool, json: bool) -> None:
    """The verb for robots."""
    from quasilpv.artifact import read_artifact
    from quasilpv.cli.results import print_warnings
    from quasilpv.cli.session import Session
    from quasilpv.experiments.hil import require_identical
    from quasilpv.experiments.result import Variant
    from quasilpv.experiments.setup import variant_of
    from quasilpv.scenarios import tracking_experiment

    given = None if asked.artifact is None else read_artifact(asked.artifact)
    bits = ENCODER_BITS if asked.encoder_bits is None else asked.encoder_bits
    variant = Variant(require_controller(asked.controller), bits)
    if given is not None:
        variant = variant_of(given, sensors_of(variant.encoder_bits))
    if asked.plant == "mujoco":
        expected = "nominal or perturbed: qlpv-simulator has no MuJoCo, design track has"
        raise InputError("command line", "--plant", asked.plant, expected)
    experiment = tracking_experiment(scenario)
    session = Session(given, asked.rate_hz, plant_kind(asked.plant, [experiment]), out, log)
    over_lcm, in_process = _run_both(session, experiment, variant, pace.talk(0.0))
    if not pace.real_time and over_lcm.fault is None:
        require_identical(over_lcm.result.run, in_process.run)
    if json:
        print_json(_row(over_lcm, in_process))
    else:
        _print(over_lcm, in_process)
    print_warnings(in_process, f"{in_process.title}, in process")
    print_warnings(over_lcm.result, f"{in_process.title}, over LCM")
    if over_lcm.fault is not None:
        raise FaultStop(over_lcm.fault)


def _run_both(
    session: Session, experiment: TrackingExperiment, variant: Variant, talk: Talk
) -> tuple[HilResult, TrackResult]:
    """The run over LCM, and the same in this process."""
    from quasilpv.experiments.hil import run_over_lcm
    from quasilpv.experiments.setup import RunSetup

    with progress(2) as steps:
        steps.begin("in process")
        in_process = session.run(experiment, variant, steps)
        steps.end()
        steps.begin("over LCM")
        over_lcm = run_over_lcm(
            RunSetup(
                experiment,
                session.controller(experiment, variant, steps),
                plant=session.plant,
                sensors=sensors_of(variant.encoder_bits),
                variant=variant,
                log=session.log,
            ),
            session.folder(experiment, variant),
            talk,
        )
        steps.end()
    return over_lcm, in_process


def _row(over_lcm: HilResult, in_process: TrackResult) -> dict[str, Any]:
    return {
        **over_lcm.result.row(),
        "mode": over_lcm.mode,
        "samples": int(over_lcm.result.run.time_s.size),
        "identical_to_in_process": over_lcm.result.run.first_difference(in_process.run) is None,
        "in_process": in_process.metrics.as_dict(),
        "fault": over_lcm.fault,
        "controller_report": over_lcm.controller,
        "simulator_report": over_lcm.simulator,
    }


def _print(over_lcm: HilResult, in_process: TrackResult) -> None:
    from quasilpv.cli.results import layout

    title = f"{in_process.title}, {in_process.plant} plant, {in_process.rate_hz:g} Hz"
    columns, cells = layout(in_process)
    rows = [cells(in_process, "in process"), cells(over_lcm.result, f"over LCM, {over_lcm.mode}")]
    print_table(title, ("", *columns[1:]), rows)
    print_latencies(over_lcm.simulator)
    print_ending(
        over_lcm.controller,
        over_lcm.simulator,
        mode=over_lcm.mode,
        samples=over_lcm.result.run.time_s.size,
        stopped=over_lcm.fault is not None,
    )
