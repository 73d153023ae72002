"""The command design: its help, its answers on standard output, and the exit codes it ends with."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from command import Design, assert_refused
from quasilpv.cli.verbs import VERBS
from quasilpv.errors import ClaimError, FaultStop, InfeasibleError, PlantError, QuasilpvError

pytest_plugins = ["command"]

HEAVY = ("sympy", "matplotlib", "scipy", "clarabel", "cvxpy", "joblib")

# ---- help and listings -----------------------------------------------------------------------------------------------


def test_when_called_alone_expect_an_explanation_with_examples(design: Design) -> None:
    outcome = design()
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out == design("--help").out
    for name, verb in VERBS.items():
        assert f"  {name:<11} {verb.summary}\n" in outcome.out


@pytest.mark.parametrize("verb", VERBS)
def test_when_help_is_asked_for_expect_an_example_on_a_line_of_its_own(design: Design, verb: str) -> None:
    outcome = design(verb, "--help")
    assert outcome.code == 0
    assert any(line.strip().startswith(f"design {verb}") for line in outcome.out.splitlines())
    assert not any(line.endswith("-") for line in outcome.out.splitlines())  # no name is broken at its hyphen


@pytest.mark.parametrize("verb", ["", "verify", "inspect"])
def test_when_no_design_is_made_expect_neither_algebra_nor_solvers_nor_plotting_loaded(verb: str) -> None:
    program = f"""
import sys
from quasilpv.cli import run
assert run([*{verb.split()!r}, "--help"]) == 0
print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"


def test_when_listed_as_json_expect_robots_controllers_and_scenarios(design: Design) -> None:
    outcome = design("list", "--json")
    known = json.loads(outcome.out)
    assert (outcome.code, outcome.err) == (0, "")
    assert {"arm2", "arm3"} <= {entry["id"] for entry in known["robots"]}
    assert {"pid", "ctc", "ctc-dob", "dob-acceleration"} <= {entry["id"] for entry in known["controllers"]}
    assert {"serial-square", "serial-circle"} <= {entry["id"] for entry in known["scenarios"]}
    table = design("list", "--items").out
    assert all(entry["id"] in table for entries in known.values() for entry in entries)


# ---- synth and inspect -----------------------------------------------------------------------------------------------


def test_when_a_controller_is_designed_expect_both_twins_and_no_other_file(design: Design, tmp_path: Path) -> None:
    outcome = design("synth", "arm3", "--design", "ctc", "--rate-hz", 2000, "-o", "here", "--json")
    answer = json.loads(outcome.out)
    assert (outcome.code, outcome.err) == (0, "")
    assert sorted(path.name for path in (tmp_path / "here").iterdir()) == ["artifact.cbor", "artifact.json"]
    for twin in ("json", "cbor"):
        contents = json.loads(design("inspect", answer["artifact"][twin], "--json").out)
        assert contents["hash"] == answer["hash"]
        assert contents["sample_period_s"] == 5e-4


def test_when_an_artifact_is_inspected_without_json_expect_a_table_that_names_its_law(
    design: Design, tmp_path: Path, artifact: bytes
) -> None:
    (tmp_path / "a.json").write_bytes(artifact)
    outcome = design("inspect", "a.json")
    assert outcome.code == 0
    assert "law" in outcome.out
    assert "pid" in outcome.out


def test_when_a_specification_is_infeasible_expect_exit_1_and_no_file(design: Design, tmp_path: Path) -> None:
    assert_refused(design("synth", "arm3", "--encoder-bits", 8, "-o", "here"), "arm3", "N m", code=1)
    assert list(tmp_path.iterdir()) == []


# ---- how it ends -----------------------------------------------------------------------------------------------------


def test_when_the_reader_of_a_pipe_leaves_expect_no_word_about_it(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "quasilpv", "list", "--json"],
        stdout=writing,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
        check=False,
    )
    os.close(writing)
    assert done.stderr == b""


def test_when_interrupted_expect_one_line_and_exit_130(design: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("quasilpv.release.release", interrupt)
    outcome = design("synth", "arm3")
    assert (outcome.code, outcome.err) == (130, "error: interrupted\n")


@pytest.mark.parametrize(
    ("error", "code", "outcome"),
    [
        (InfeasibleError("no gains"), 1, "infeasible"),
        (ClaimError("an inequality fails"), 1, "claim fails"),
        (FaultStop("fault F2 at 0.000 s: plant silent"), 3, "fault"),
        (QuasilpvError("of no kind"), 70, None),
        (PlantError("singular"), 6, None),
    ],
)
def test_when_a_verb_ends_without_its_answer_expect_json_to_tell_which_outcome_it_was(
    error: QuasilpvError, code: int, outcome: str | None, design: Design, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("quasilpv.release.release", fail)
    ended = design("synth", "arm3", "--json")
    assert (ended.code, ended.err) == (code, f"error: {error}\n")
    assert ended.out == "" if outcome is None else json.loads(ended.out) == {"outcome": outcome, "reason": str(error)}
    assert design("synth", "arm3").out == ""


@pytest.mark.parametrize("mistake", ["raise MemoryError", "f = lambda: f(); f()"])
def test_when_the_program_is_wrong_expect_one_line_a_code_of_its_own_and_the_traceback_on_demand(mistake: str) -> None:
    program = f"""
from quasilpv.cli import app
def wrong(**_):
    {mistake}
app.app = wrong
app.main()
"""
    for variables, tells in (({}, False), ({"QUASILPV_TRACEBACK": "1"}, True)):
        environment = {**os.environ, **variables}
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (70, "")
        assert ("Traceback" in done.stderr) == tells
        assert done.stderr.splitlines()[-1].startswith("error: ")
        assert tells or done.stderr.count("\n") == 1
