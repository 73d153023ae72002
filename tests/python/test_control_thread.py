"""What the control thread of `qlpv-controller` asks of the kernel, as strace sees it: its clock and its link."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from two_processes import Experiment, finish

pytest_plugins = ["two_processes"]

DURATION_S = 0.1
COMMANDS = 100
A_PIPE = r"(?:[3-9]|\d\d+)<pipe:"
"""Not one of the standard streams."""
LINK_AND_CLOCK = {
    "clock_gettime": "",  # where it is not answered in user space
    "clock_nanosleep": "",
    "ppoll": r"\[\{fd=" + A_PIPE,  # our wait for LCM's thread that receives
    "pselect6": r"\d+, \[" + A_PIPE,  # LCM's own
    "read": A_PIPE,
    "write": A_PIPE,
    "futex": "",  # LCM's queue of received packets
    "sendmsg": r"\d+<socket:",
}
"""Calls a control thread may make, and how their arguments begin."""


@pytest.fixture(scope="module")
def strace() -> str:
    program = shutil.which("strace")
    if program is None:
        pytest.skip("strace is not installed")
    if subprocess.run([program, "-qq", "-o", "/dev/null", "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("tracing processes is not permitted here")
    return program


def control_thread(trace: str) -> list[tuple[str, str]]:
    """Names and arguments of the calls of the first thread; those that others interrupted appear once."""
    main = trace.split(maxsplit=1)[0]
    return re.findall(rf"^{main} +(\w+)\((.*)$", trace, flags=re.MULTILINE)


def foreign(calls: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """The calls that serve neither link nor clock."""
    return [(name, text) for name, text in calls if not re.match(LINK_AND_CLOCK.get(name, "(?!)"), text)]


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_when_the_control_thread_is_traced_expect_calls_of_the_clock_and_the_link_only(
    experiment: Experiment, strace: str, mode: str
) -> None:
    experiment.set_duration(DURATION_S)
    trace = experiment.folder / "trace.txt"
    tracing = [strace, "-f", "-y", "-qq", "-e", "signal=none", "-o", str(trace)]
    controller = experiment.start([*tracing, *experiment.controller_command("--mode", mode, "--silence-s", "5")])
    assert experiment.run(experiment.simulator_command("--mode", mode, "--hold-s", "5"))[0] == 0
    assert finish(controller)[0] == 0
    calls = control_thread(trace.read_text())
    waits = [place for place, (name, _) in enumerate(calls) if name == "ppoll"]
    loop = calls[waits[0] : waits[-1]]
    sent = [text for name, text in loop if name == "sendmsg"]
    assert len(sent) >= COMMANDS / 2  # in real time a traced process may answer late
    assert foreign(loop) == []
    assert len({text.split(",")[0] for name, text in loop if name == "futex"}) <= 1, "more than LCM's one lock"
    assert foreign(calls[: waits[0]]), "a start without a single file opened: nothing was traced"
