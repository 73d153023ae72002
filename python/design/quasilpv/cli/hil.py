"""``design hil``: one scenario with controller and plant as two processes over LCM."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from quasilpv.artifact import read_artifact
from quasilpv.cli.console import JsonOption, print_json, print_table, progress
from quasilpv.cli.options import (
    ArtifactOption,
    EncoderOption,
    PlantOption,
    RateOption,
    designed,
    plant_kind,
    require_controller,
    sensors_of,
)
from quasilpv.cli.results import COLUMNS, cells
from quasilpv.errors import FaultStop, InputError
from quasilpv.experiments.hil import HilResult, Mode, RealTimeOptions, require_identical, run_over_lcm
from quasilpv.experiments.result import TrackResult, Variant
from quasilpv.experiments.track import PlantKind, TrackingExperiment, track, variant_of
from quasilpv.scenarios import ENCODER_BITS
from quasilpv.synthesis import DEFAULT_CONTROLLER

LATENCIES = ("wakeup_ns", "round_trip_ns")
COUNTERS = ("missed_commands", "late_commands", "watchdog_samples", "overruns", "skipped_ticks")
QUANTILES = ("p50", "p99", "p99_9", "max")


def hil_command(
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help="Scenario id, see design list.")],
    *,
    real_time: Annotated[bool, typer.Option("--real-time", help="Paced by the clock instead of lock-step.")] = False,
    silence_s: Annotated[
        float, typer.Option("--silence-s", min=1e-3, help="Real time: fault after so long without a measurement.")
    ] = RealTimeOptions.silence_s,
    hold_s: Annotated[
        float, typer.Option("--hold-s", min=1e-3, help="Real time: the plant brakes after so long without a command.")
    ] = RealTimeOptions.hold_s,
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
    if priority is not None and not real_time:
        raise InputError("command line", "--priority", priority, "nothing without --real-time: lock-step has no clock")
    experiment = TrackingExperiment.registered(scenario)
    kind = cast(PlantKind, plant_kind(plant))
    variant = Variant(require_controller(controller), ENCODER_BITS if encoder_bits is None else encoder_bits)
    sensors = sensors_of(variant.encoder_bits)
    given = None if artifact is None else read_artifact(artifact)
    with progress(2) as steps:
        steps.begin("in process")
        chosen = given or designed(experiment.robot.id, variant, rate_hz, steps.parts)
        if given is not None:
            variant = variant_of(given, sensors)
        folder = out / experiment.name / variant.slug
        in_process = track(experiment, chosen, folder, plant=kind, sensors=sensors, variant=variant)
        steps.end()
        steps.begin("over LCM")
        mode: Mode = "realtime" if real_time else "lockstep"
        over_lcm = run_over_lcm(
            experiment,
            chosen,
            folder,
            plant=kind,
            sensors=sensors,
            mode=mode,
            real_time=RealTimeOptions(silence_s, hold_s, priority),
            variant=variant,
            url=url,
            key=key,
        )
        steps.end()
    if not real_time and over_lcm.fault is None:
        require_identical(over_lcm.result.run, in_process.run)
    if json:
        print_json(_row(over_lcm, in_process))
    else:
        _print(over_lcm, in_process)
    if over_lcm.fault is not None:
        raise FaultStop(over_lcm.fault)


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
    title = f"{in_process.title}, {in_process.plant} plant, {in_process.rate_hz:g} Hz"
    columns = ("", *COLUMNS[1:])
    print_table(title, columns, [cells(in_process, "in process"), cells(over_lcm.result, f"over LCM, {over_lcm.mode}")])
    latencies = {name: over_lcm.simulator[name] for name in LATENCIES if over_lcm.simulator[name] is not None}
    rows = [
        (name.removesuffix("_ns").replace("_", " "), *(f"{latency[q] / 1e3:.1f}" for q in QUANTILES))
        for name, latency in latencies.items()
    ]
    print_table("latency at the plant, us", ("", *QUANTILES), rows)
    if over_lcm.fault is not None:
        post_mortem = over_lcm.controller["post_mortem"]
        seq = post_mortem["seq"] if post_mortem else []
        print(f"stopped by a fault; the last {len(seq)} samples before it are in --json, controller_report.post_mortem")
    elif over_lcm.mode == "lockstep":
        print(f"{over_lcm.result.run.time_s.size} samples, identical to the run in process")
    else:
        print(", ".join(f"{name.replace('_', ' ')}: {over_lcm.simulator[name]}" for name in COUNTERS))
