"""The command lines of both executables: every option that --help lists, with every value that is none of its type.

And what both do with standard streams and stacks that cannot take what they are asked for.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from two_processes import Experiment, executable, finish

pytest_plugins = ["two_processes"]

ROOT = Path(__file__).parents[2]
CONTROLLER, SIMULATOR = "qlpv-controller", "qlpv-simulator"
COMMANDS = ((CONTROLLER,), (CONTROLLER, "--doctor"), (CONTROLLER, "--reset-fault"), (SIMULATOR,))

NOT_NUMBERS = ("nan", "inf", "-inf", "1e400", "", " ", "0x10", "1,5", "+1", "1e", "1\n2")
VALUES = (*NOT_NUMBERS, "1e18", "-1", "9223372036854775808")
REFUSED = {None: VALUES, "NUMBER": VALUES, "INTEGER": VALUES, "WORD": VALUES, "URL": VALUES, "FILE": ("",)}
"""Values that an option of each type refuses; a flag (None) takes none, and a file may have any name but none."""


class Option(NamedTuple):
    """An option as --help shows it: its type, None of a flag, and its bounds, of numbers."""

    name: str
    type: str | None
    low: float
    high: float


def run(command: tuple[str, ...], *arguments: str) -> subprocess.CompletedProcess[str]:
    program, *mode = command
    return subprocess.run([executable(program), *mode, *arguments], capture_output=True, text=True, check=False)


def shell(script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A script of bash, whose arguments are $1, $2, ..."""
    return subprocess.run(["bash", "-c", script, "-", *arguments], capture_output=True, text=True, check=False)


@cache
def options(command: tuple[str, ...]) -> tuple[Option, ...]:
    """What --help lists. A description may go on in the next line, an option begins after two spaces."""
    entries = re.split(r"\n  (?=-)", run(command, "--help").stdout.partition("\nOptions:")[2].partition("\n\n")[0])
    found = []
    for entry in entries:
        head = re.match(r"\s*(?:-\w,)?(--[\w-]+)(?: ([A-Z]+)\b)?", entry)
        if head is None or head[1] == "--help":
            continue
        bounds = re.search(r"\((-?[\d.e+-]+) to ([\d.e+-]+)[;)]", " ".join(entry.split()))
        low, high = (float(bounds[1]), float(bounds[2])) if bounds else (0.0, 0.0)
        found.append(Option(head[1], head[2], low, high))
    return tuple(found)


EVERY = [(command, option) for command in COMMANDS for option in options(command)]
every_option = pytest.mark.parametrize(
    ("command", "option"), EVERY, ids=[" ".join((*command, option.name)) for command, option in EVERY]
)
every_command = pytest.mark.parametrize("command", COMMANDS, ids=" ".join)


def require_one_line(done: subprocess.CompletedProcess[str], name: str) -> None:
    assert (done.returncode, done.stdout) == (2, ""), done
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert name.removeprefix("--") in done.stderr


@every_option
def test_every_option_with_every_value_that_is_none_of_its_type_is_exit_2_and_one_line(
    command: tuple[str, ...], option: Option
) -> None:
    assert option.type in REFUSED, f"{option.name} has no declared type"
    for value in REFUSED[option.type]:
        require_one_line(run(command, f"{option.name}={value}"), option.name)
        if option.type is not None:
            require_one_line(run(command, option.name, value), option.name)


@every_option
def test_every_number_is_bounded_as_the_help_says(command: tuple[str, ...], option: Option) -> None:
    if option.type not in ("NUMBER", "INTEGER"):
        pytest.skip("no number")
    assert option.low < option.high
    integer = option.type == "INTEGER"
    beyond = (int(option.low) - 1, int(option.high) * 10) if integer else (option.low / 2 - 1e-9, option.high * 2)
    for value in beyond:
        require_one_line(run(command, option.name, f"{value:d}" if integer else f"{value!r}"), option.name)


def test_a_value_is_missing_or_given_twice_or_the_option_unknown_expect_one_line() -> None:
    for command, option in EVERY:
        if option.type is not None:
            require_one_line(run(command, option.name), option.name)
    for command in COMMANDS:
        for unknown in ("--nonsense", "nonsense", "--Json", "-j"):
            require_one_line(run(command, unknown), "")
    twice = run((CONTROLLER,), "--timeout-s", "1", "--timeout-s", "2")
    require_one_line(twice, "timeout-s")


def test_the_documented_exit_codes_are_those_of_the_help_pages() -> None:
    page = (ROOT / "docs/reference/messages.md").read_text(encoding="utf-8").partition("## Exit codes")[2]
    documented = {int(code) for code in re.findall(r"^\| (\d+) \|", page, flags=re.MULTILINE)}
    listed = set()
    for command in COMMANDS:
        codes = run(command, "--help").stdout.partition("Exit codes:")[2].split("\n\n")[0]
        listed |= {int(code) for code in re.findall(r"(?:^|;)\s+(\d+) ", codes)}
    assert documented == listed


@every_command
@pytest.mark.parametrize("target", [">/dev/full", ">&-"])
def test_when_the_help_cannot_be_written_expect_a_line_and_exit_2(command: tuple[str, ...], target: str) -> None:
    program, *mode = command
    done = shell(f'"$@" {target}', executable(program), *mode, "--help")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr


@pytest.mark.parametrize("json_report", [True, False])
@pytest.mark.parametrize("target", [">/dev/full", ">&-"])
def test_when_the_report_cannot_be_written_expect_a_line_and_exit_2_of_both_and_whole_records(
    experiment: Experiment, target: str, json_report: bool
) -> None:
    commands = [experiment.controller_command(), experiment.simulator_command()]
    if not json_report:
        commands = [[word for word in command if word != "--json"] for command in commands]
    processes = [experiment.start(["bash", "-c", f'exec "$@" {target}', "-", *command]) for command in commands]
    for process in processes:
        code, _, errors = finish(process)
        assert code == 2, errors
        assert re.fullmatch(r"qlpv-\w+: standard output: got [^\n]+, expected room for the report\n", errors)
    for record in ("controller.csv", "plant.csv"):
        assert len(experiment.columns(record)["seq"]) == 300


def test_when_the_reader_of_the_report_left_expect_exit_141_and_the_record(experiment: Experiment) -> None:
    controller = experiment.start(experiment.controller_command())
    plant = experiment.start(experiment.simulator_command())
    assert plant.stdout is not None
    plant.stdout.close()
    plant.stdout = None
    plant.communicate(timeout=60)
    assert plant.returncode == 141
    assert finish(controller)[0] == 0
    assert len(experiment.columns("plant.csv")["seq"]) == 300


@every_command
@pytest.mark.parametrize("kibibytes", [64, 512])
def test_when_the_stack_is_too_small_expect_a_line_and_no_segmentation_fault(
    command: tuple[str, ...], kibibytes: int
) -> None:
    program, *mode = command
    done = shell(f'ulimit -s {kibibytes}; exec "$@"', executable(program), *mode)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert f"stack limit: got {kibibytes} KiB, expected at least 1024 KiB" in done.stderr


def test_when_the_stack_of_design_is_too_small_expect_a_line_and_no_segmentation_fault() -> None:
    done = shell('ulimit -s 256; exec "$@"', sys.executable, "-c", "from quasilpv.cli import main; main()", "list")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert "stack limit: got 256 KiB, expected at least 1024 KiB" in done.stderr


def test_when_the_stack_is_as_small_as_it_may_be_expect_the_run(experiment: Experiment) -> None:
    smallest = ["bash", "-c", 'ulimit -s 1024; exec "$@"', "-"]
    controller = experiment.start([*smallest, *experiment.controller_command("--priority", "50")])
    code, report, errors = experiment.run([*smallest, *experiment.simulator_command("--priority", "50")])
    assert (code, report["samples"]) == (0, 300), errors
    assert finish(controller)[0] == 0


def test_when_this_machine_cannot_hold_the_rate_expect_the_doctor_to_say_no_with_its_exit_code() -> None:
    done = run((CONTROLLER,), "--doctor", "--rate-hz", "100000", "--seconds", "0.05", "--json")
    report = json.loads(done.stdout)
    assert report["verdict"] == "does not hold the rate"
    assert done.returncode == 1
    if os.geteuid() == 0:
        alone = shell('exec unshare -n "$@"', executable(CONTROLLER), "--doctor", "--seconds", "0.05", "--json")
        if "unshare" not in alone.stderr:
            assert alone.returncode == 5
            assert json.loads(alone.stdout)["verdict"].startswith("cannot run")
