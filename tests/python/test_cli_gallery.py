"""Figures drawn by another process are those that this one draws, and are drawn whatever becomes of that process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import joblib
import pytest

from quasilpv.cli.gallery import Gallery
from quasilpv.errors import InputError
from quasilpv.experiments.result import TrackResult, Variant
from reference.runs import synthetic_result

FORMATS = ("png",)
RESULTS = [synthetic_result(Variant(name), 1) for name in ("pid", "dob-acceleration")]


def drawn(folder: Path, results: list[TrackResult]) -> dict[str, bytes]:
    with Gallery(folder, FORMATS, len(results)) as gallery:
        for result in results:
            gallery.add(result)
        gallery.finish()
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.png")}


def test_one_core_and_two_draw_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = []
    for cores in (1, 2):
        monkeypatch.setattr(joblib, "cpu_count", lambda cores=cores: cores)
        files.append(drawn(tmp_path / str(cores), RESULTS))
    assert files[0] == files[1]
    assert any("comparison" in name for name in files[0])
    assert {name.split(os.sep)[1] for name in files[0]} == {"pid", "dob-acceleration", "comparison.png"}


def test_what_the_other_process_could_not_write_is_told_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joblib, "cpu_count", lambda: 2)
    folder = tmp_path / RESULTS[0].scenario
    folder.mkdir()
    (folder / "pid").write_text("a file where a folder should be")
    with pytest.raises(InputError, match="pid"):
        drawn(tmp_path, RESULTS)


def test_when_the_other_process_is_killed_expect_every_figure_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = drawn(tmp_path / "whole", RESULTS)
    monkeypatch.setattr(joblib, "cpu_count", lambda: 2)
    folder = tmp_path / "killed"
    with Gallery(folder, FORMATS, 2) as gallery:
        gallery.add(RESULTS[0])
        assert gallery._workers is not None
        for process in list(gallery._workers._processes.values()):
            os.kill(process.pid or 0, signal.SIGKILL)
            process.join()
        gallery.add(RESULTS[1])
        gallery.finish()
    assert {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.png")} == expected


INTERRUPTED = """
import os, signal, sys, time, joblib
from pathlib import Path
sys.path.insert(0, {tests!r})
joblib.cpu_count = lambda: 2
from quasilpv.cli.gallery import Gallery
from quasilpv.experiments.result import Variant
from reference.runs import synthetic_result
if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    results = [synthetic_result(Variant(name), 1) for name in ("pid", "dob-acceleration")]
    try:
        with Gallery(Path({folder!r}), ("png",), 2) as gallery:
            for result in results:
                gallery.add(result)
            print("begun", flush=True)
            gallery.finish()
            time.sleep(60)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
"""


@pytest.mark.parametrize("after_s", [0.0, pytest.param(0.5, marks=pytest.mark.full)])
def test_an_interrupt_from_the_terminal_is_heard_by_this_process_alone(tmp_path: Path, after_s: float) -> None:
    program = tmp_path / "program.py"
    program.write_text(INTERRUPTED.format(tests=str(Path(__file__).parent), folder=str(tmp_path / "out")))
    with subprocess.Popen(
        [sys.executable, str(program)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(after_s)
        os.killpg(process.pid, signal.SIGINT)
        out, errors = process.communicate(timeout=60)
    assert (out, process.returncode) == ("interrupted\n", 0)
    assert "Traceback" not in errors
