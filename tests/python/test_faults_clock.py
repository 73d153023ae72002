"""Fault F18: steps of the wall clock have no effect, because nothing reads it."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from two_processes import ROOT, SAMPLES, Experiment, finish

pytest_plugins = ["two_processes"]

WALL_CLOCKS = re.compile(
    r"system_clock|CLOCK_REALTIME|CLOCK_TAI|gettimeofday|std::time\b|\btime\(|localtime|strftime|high_resolution_clock"
)

JUMPING_CLOCK = r"""
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static int calls;

/* An hour ahead, then an hour back: never twice the same wall clock. */
static long step(void) { return ++calls % 2 ? 3600 : -3600; }

int clock_gettime(clockid_t clock, struct timespec* now) {
  int status = (int)syscall(SYS_clock_gettime, clock, now);
  if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) now->tv_sec += step();
  return status;
}

int gettimeofday(struct timeval* now, void* zone) {
  struct timespec precise;
  (void)zone;
  clock_gettime(CLOCK_REALTIME, &precise);
  now->tv_sec = precise.tv_sec;
  now->tv_usec = precise.tv_nsec / 1000;
  return 0;
}

time_t time(time_t* now) {
  struct timespec precise;
  clock_gettime(CLOCK_REALTIME, &precise);
  if (now) *now = precise.tv_sec;
  return precise.tv_sec;
}
"""


@pytest.fixture(scope="module")
def jumping_clock(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A library that replaces the wall clock by one that jumps, for LD_PRELOAD."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("clock")
    (folder / "clock.c").write_text(JUMPING_CLOCK)
    library = str(folder / "clock.so")
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, str(folder / "clock.c")], check=True)
    shown = subprocess.run(
        ["date", "+%s"],
        env={"LD_PRELOAD": library, "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    real = subprocess.run(["date", "+%s"], capture_output=True, text=True, check=True)
    assert abs(int(shown.stdout) - int(real.stdout)) > 1800, "the library does not move the clock"
    return library


def test_F18_when_the_wall_clock_jumps_expect_the_same_lock_step_run_bit_for_bit(
    experiment: Experiment, jumping_clock: str
) -> None:
    controller = experiment.start(experiment.controller_command())
    assert experiment.run(experiment.simulator_command())[0] == 0
    assert finish(controller)[0] == 0
    steady = (experiment.folder / "plant.csv").read_bytes()
    controller = experiment.start(experiment.controller_command(), LD_PRELOAD=jumping_clock)
    assert experiment.run(experiment.simulator_command(), LD_PRELOAD=jumping_clock)[0] == 0
    assert finish(controller)[0] == 0
    assert (experiment.folder / "plant.csv").read_bytes() == steady


def test_F18_when_the_wall_clock_jumps_in_real_time_expect_no_fault_no_timeout_and_every_sample(
    experiment: Experiment, jumping_clock: str
) -> None:
    # Within the hour that the clock jumps, beyond what a busy machine may stop a process for.
    patient = ("--mode", "realtime", "--timeout-s", "30")
    controller = experiment.start(experiment.controller_command(*patient, "--silence-s", "5"), LD_PRELOAD=jumping_clock)
    code, plant, _ = experiment.run(experiment.simulator_command(*patient, "--hold-s", "5"), LD_PRELOAD=jumping_clock)
    _, report, _ = finish(controller)
    assert (code, plant["samples"], plant["watchdog_samples"]) == (0, SAMPLES, 0)
    assert report["fault_cause"] in ("none", "measurement lost")  # the latter: a pause of 20 samples


def test_F18_no_source_of_the_runtime_reads_the_wall_clock() -> None:
    sources = [path for path in sorted(Path(ROOT / "cpp").rglob("*")) if path.suffix in (".cpp", ".hpp")]
    assert len(sources) > 50
    found = [str(path) for path in sources if WALL_CLOCKS.search(path.read_text())]
    assert found == []
    assert WALL_CLOCKS.search("std::chrono::system_clock::now()")
