"""The command in odd surroundings: what the environment holds is neutralised or answered with a line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import release
from quasilpv.scenarios import Sensors, TrackingExperiment
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import robot
from quasilpv.telemetry import LOG_NAME
from quasilpv.trajectories import rest

ODD = {
    "MPLBACKEND": "nonsense",
    "MATPLOTLIBRC": "/proc/self/exe",
    "MPLCONFIGDIR": "/proc/nowhere",
    "SOURCE_DATE_EPOCH": "abc",
    "COLUMNS": "-3",
    "LINES": "many",
    "TERM": "nonsense",
    "FORCE_COLOR": "perhaps",
    "NO_COLOR": "",
    "HOME": "/nowhere",
    "XDG_CONFIG_HOME": "relative",
    "TMPDIR": "/nowhere",
    "LOKY_MAX_CPU_COUNT": "abc",
    "OMP_NUM_THREADS": "-1",
    "PYTHONWARNINGS": "error",
    "PYTHONIOENCODING": "ascii:strict",
    "PYTHONUTF8": "0",
    "PYTHONCOERCECLOCALE": "0",
    "LC_ALL": "C",
    "LANG": "xx_YY.nonsense",
    "TZ": "Nowhere/Land",
}
TEX = "text.usetex: True\nfont.family: nonsense\nbackend: nonsense\nsavefig.dpi: banana\nno setting\n"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    experiment = TrackingExperiment("hold", robot("arm3"), rest("hold", 3, 0.05))
    artifact = release(DesignRequest.of("arm3", "pid", Specification())).artifact
    track(RunSetup(experiment, artifact, plant="nominal", sensors=Sensors()), folder)
    return folder / LOG_NAME


def design(folder: Path, *arguments: object, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "quasilpv", *map(str, arguments)]
    environment = {**os.environ, **variables}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def assert_drawn(done: subprocess.CompletedProcess[str], folder: Path) -> None:
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.startswith("wrote path.png, ")
    assert done.stderr.count("\n") == 1
    assert (folder / "r" / "path.png").stat().st_size > 1000


def test_when_everything_around_is_odd_at_once_expect_the_figures_all_the_same(log: Path, tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_bytes(b"\xff\xfe\x00 no text")
    assert_drawn(design(tmp_path, "log", "plot", log, "-o", "r", **ODD), tmp_path)


@pytest.mark.full
@pytest.mark.parametrize("name", ODD)
def test_when_one_variable_is_odd_expect_the_figures_all_the_same(name: str, log: Path, tmp_path: Path) -> None:
    assert_drawn(design(tmp_path, "log", "plot", log, "-o", "r", **{name: ODD[name]}), tmp_path)


@pytest.mark.full
def test_when_there_is_no_environment_at_all_expect_the_figures_all_the_same(log: Path, tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_text(TEX)
    command = ["env", "-i", sys.executable, "-m", "quasilpv", "log", "plot", str(log), "-o", "r"]
    assert_drawn(subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False), tmp_path)


def test_when_its_folder_is_gone_expect_what_needs_none_and_a_line_for_the_rest(tmp_path: Path) -> None:
    program = f"""
import os, sys
os.mkdir("gone")
os.chdir("gone")
os.rmdir(os.path.abspath("."))
os.execv({sys.executable!r}, [{sys.executable!r}, "-m", "quasilpv", *sys.argv[1:]])
"""
    command = [sys.executable, "-c", program, "inspect", "artifact.json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: artifact.json: file: got No such file or directory, expected a readable file\n"


@pytest.mark.parametrize("kibibytes", [128, 256])
def test_when_the_stack_is_too_small_expect_a_line(kibibytes: int, tmp_path: Path) -> None:
    """Below about 100 kB the interpreter itself does not start."""
    command = ["prlimit", f"--stack={kibibytes << 10}:{kibibytes << 10}", sys.executable, "-m", "quasilpv", "list"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"error: process: stack limit: got {kibibytes} KiB, expected at least 1024 KiB (ulimit -s)\n"
