"""``design hil``: one scenario with controller and plant as two processes over LCM."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from quasilpv.cli.console import JsonOption, print_json, print_table, progress
from quasilpv.cli.options import (
    ArtifactOption,
    EncoderOption,
    LogOption,
    PlantOption,
    RateOption,
    plant_kind,
    require_controller,
    sensors_of,
)
from quasilpv.defaults import ENCODER_BITS, WATCHDOG_S
from quasilpv.errors import FaultStop, InputError
from quasilpv.synthesis import DEFAULT_CONTROLLER

if TYPE_CHECKING:
    from quasilpv.cli.session import Session
    from quasilpv.experiments.hil import HilResult, RealTimeOptions
    from quasilpv.experiments.result import TrackResult, Variant
    from quasilpv.scenarios import TrackingExperiment

LATENCIES = ("wakeup_ns", "round_trip_ns")
COUNTERS = ("missed_commands", "late_commands", "watchdog_samples", "overruns", "skipped_ticks")
QUANTILES = ("p50", "p99", "p99_9", "max")


def hil_command(
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help="Scenario id, see design list.")],
    *,
    real_time: Annotated[bool, typer.Option("--real-time", help="Paced by the clock instead of lock-step.")] = False,
    silence_s: Annotated[
        float, typer.Option("--silence-s", min=1e-3, help="Real time: fault after so long without a measurement.")
    ] = WATCHDOG_S,
    hold_s: Annotated[
        float, typer.Option("--hold-s", min=1e-3, help="Real time: the plant brakes after so long without a command.")
    ] = WATCHDOG_S,
    priority: Annotated[
        int | None, typer.Option("--priority", min=1, max=99, help="Real time: lock memory, use SCHED_FIFO.")
    ] = None,
    controller: Annotated[str, typer.Option("--controller", metavar="ID")] = DEFAULT_CONTROLLER,
    artifact: ArtifactOption = None,
    rate_hz: RateOption = None,
    encoder_bits: EncoderOption = None,
    plant: PlantOption = "perturbed",
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
) -> None:
    """Run a scenario with controller and plant as two processes over LCM, and once more in this process.

    In lock-step both runs must be identical, bit for bit (exit code 1 if they are not). With --real-time the rms of
    both is printed with the measured wake-up and round-trip latencies beside it. A run that a fault stopped is printed
    all the same, and ends with exit code 3.

    \b
    Example:
      design hil serial-square --real-time
    """
    from quasilpv.artifact import read_artifact
    from quasilpv.cli.results import print_warnings
    from quasilpv.cli.session import Session
    from quasilpv.experiments.hil import RealTimeOptions, require_identical
    from quasilpv.experiments.result import Variant
    from quasilpv.experiments.setup import variant_of
    from quasilpv.scenarios import tracking_experiment

    if priority is not None and not real_time:
        raise InputError("command line", "--priority", priority, "nothing without --real-time: lock-step has no clock")
    given = None if artifact is None else read_artifact(artifact)
    variant = Variant(require_controller(controller), ENCODER_BITS if encoder_bits is None else encoder_bits)
    if given is not None:
        variant = variant_of(given, sensors_of(variant.encoder_bits))
    if plant == "mujoco":
        expected = "nominal or perturbed: qlpv-simulator has no MuJoCo, design track has"
        raise InputError("command line", "--plant", plant, expected)
    experiment = tracking_experiment(scenario)
    session = Session(given, rate_hz, plant_kind(plant, [experiment]), out, log)
    over_lcm, in_process = _run_both(
        session,
        experiment,
        variant,
        RealTimeOptions(silence_s, hold_s, priority) if real_time else None,
        url=url,
        key=key,
    )
    if not real_time and over_lcm.fault is None:
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
    session: Session,
    experiment: TrackingExperiment,
    variant: Variant,
    real_time: RealTimeOptions | None,
    *,
    url: str | None,
    key: Path | None,
) -> tuple[HilResult, TrackResult]:
    """The run over LCM, in lock-step without options of real time, and the same in this process."""
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
            mode="lockstep" if real_time is None else "realtime",
            real_time=real_time,
            url=url,
            key=key,
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
    latencies = {name: over_lcm.simulator[name] for name in LATENCIES if over_lcm.simulator[name] is not None}
    waits = [
        (name.removesuffix("_ns").replace("_", " "), *(f"{latency[q] / 1e3:.1f}" for q in QUANTILES))
        for name, latency in latencies.items()
    ]
    print_table("latency at the plant, us", ("", *QUANTILES), waits)
    if over_lcm.fault is not None:
        post_mortem = over_lcm.controller["post_mortem"]
        seq = post_mortem["seq"] if post_mortem else []
        print(f"stopped by a fault; the last {len(seq)} samples before it are in --json, controller_report.post_mortem")
    elif over_lcm.mode == "lockstep":
        print(f"{over_lcm.result.run.time_s.size} samples, identical to the run in process")
    else:
        print(", ".join(f"{name.replace('_', ' ')}: {over_lcm.simulator[name]}" for name in COUNTERS))
