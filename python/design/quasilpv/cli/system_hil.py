"""What ``hil`` does with the artifact of a general system."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from quasilpv.cli.console import print_json, print_note, print_table, progress
from quasilpv.cli.pacing import Pacing, print_ending, print_latencies
from quasilpv.cli.system_options import SystemOptions, artifact_of_system, code_of, folder_name, notes_of, rows_of
from quasilpv.errors import FaultStop

if TYPE_CHECKING:
    from quasilpv.experiments.system_hil import SystemHilResult
    from quasilpv.experiments.system_run import SystemRun

WATCHDOG_SAMPLES = 3.0


def run_system(path: Path, options: SystemOptions, pace: Pacing, *, out: Path, log: bool, json: bool) -> int:
    """Run it over LCM and once more in this process, and say what happened.

    Returns:
        Exit code 1 if the run began inside its region and did not stay.

    Raises:
        InputError: an option or the artifact is wrong.
        ClaimError: in lock-step both runs differ.
        FaultStop: a fault stopped the run.
    """
    from quasilpv.experiments.system_hil import require_identical, run_system_over_lcm
    from quasilpv.experiments.system_run import scenario_of, simulate_scenario

    artifact = artifact_of_system(path, "design hil SCENARIO")
    scenario = scenario_of(artifact, options.experiment(), str(path))
    folder = out / folder_name(artifact)
    with progress(2) as steps:
        steps.begin("in process")
        in_process = simulate_scenario(artifact, scenario, str(path))
        steps.end()
        steps.begin("over LCM")
        talk = pace.talk(WATCHDOG_SAMPLES * artifact.sample_period_s)
        over_lcm = run_system_over_lcm(artifact, scenario, folder, talk, log=log)
        steps.end()
    if not pace.real_time and over_lcm.stop is None:
        require_identical(over_lcm.run, in_process)
    if json:
        print_json(_row(over_lcm, in_process))
    else:
        _print(over_lcm)
    if over_lcm.stop is not None:
        raise FaultStop(str(over_lcm.stop))
    return code_of(over_lcm.run)


def _row(over_lcm: SystemHilResult, in_process: SystemRun) -> dict[str, Any]:
    return {
        **over_lcm.run.to_document(),
        "mode": over_lcm.mode,
        "identical_to_in_process": over_lcm.run.first_difference(in_process) is None,
        "in_process": in_process.to_document(),
        "fault": None if over_lcm.stop is None else str(over_lcm.stop),
        "controller_report": over_lcm.controller,
        "simulator_report": over_lcm.simulator,
    }


def _print(over_lcm: SystemHilResult) -> None:
    print_table(f"{over_lcm.run.artifact.name}, over LCM, {over_lcm.mode}", ("", ""), rows_of(over_lcm.run), 2)
    print_latencies(over_lcm.simulator)
    print_ending(
        over_lcm.controller,
        over_lcm.simulator,
        mode=over_lcm.mode,
        samples=len(over_lcm.run.time_s),
        stopped=over_lcm.stop is not None,
    )
    for note in notes_of(over_lcm.run):
        print_note(note)
