"""The command design: what it prints, where, and its exit codes; a user's mistake is one line and leaves nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np
import pytest

from quasilpv.artifact import Artifact, read_artifact, write_artifact
from quasilpv.cli import run
from quasilpv.cli.verbs import VERBS
from quasilpv.documents.canonical import canonical_json, parse_document, with_hash
from quasilpv.errors import ClaimError, FaultStop, InfeasibleError, PlantError, QuasilpvError
from quasilpv.experiments.result import Variant
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest
from quasilpv.telemetry import read_log

HEAVY = ("sympy", "matplotlib", "scipy", "clarabel", "cvxpy", "joblib")
ROW = {
    "scenario": str,
    "controller": str,
    "rate_hz": float,
    "rms_x_m": float,
    "rms_y_m": float,
    "rms_z_m": NoneType,
    "mav_x_m": float,
    "mav_y_m": float,
    "rms_tool_m": float,
    "max_tool_m": float,
    "rms_torque_nm": float,
    "rms_torque_increment_nm": float,
    "rms_velocity_error_rad_s": float,
    "share_at_limit": float,
    "largest_premise_excess": float | None,
    "worst_growth_rate_per_s": float | None,
    "plant": str,
    "sensors": dict,
}


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


Design = Callable[..., Outcome]


@pytest.fixture
def design(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Design:
    """The command in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        code = run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return call


@pytest.fixture(scope="module")
def artifact(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Bytes of a valid artifact."""
    folder = tmp_path_factory.mktemp("pid")
    assert run(["synth", "arm3", "--design", "pid", "-o", str(folder), "--json"]) == 0
    return (folder / "artifact.json").read_bytes()


def assert_refused(outcome: Outcome, *mentions: str, code: int = 2) -> None:
    assert outcome.code == code
    assert outcome.out == ""
    assert outcome.err.startswith("error: ")
    assert outcome.err.count("\n") == 1
    for text in mentions:
        assert text in outcome.err


def in_a_process(*arguments: object, cwd: Path) -> Outcome:
    command = [sys.executable, "-m", "quasilpv", *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    return Outcome(done.returncode, done.stdout, done.stderr)


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


# ---- mistakes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "mentions"),
    [
        (["synth", "arm9"], ["arm9", "arm3"]),
        (["synth", "arm3", "--design", "lqr"], ["lqr", "dob-acceleration"]),
        (["synth", "arm3", "--rate-hz", "-5"], ["rate_hz", "-5"]),
        (["synth", "arm3", "--rate-hz", "nan"], ["--rate-hz", "nan"]),
        (["synth", "arm3", "--rate-hz", "fast"], ["--rate-hz"]),
        (["synth"], ["ROBOT"]),
        (["track"], ["SCENARIO"]),
        (["track", "serial-star"], ["serial-star", "serial-square"]),
        (["track", "serial-square", "--controller", "lqr"], ["lqr"]),
        (["track", "serial-square", "--plant", "broken"], ["broken", "perturbed"]),
        (["track", "serial-square", "--encoder-bits", "64"], ["64"]),
        (["track", "serial-square", "--no-compensation", "--controller", "pid"], ["pid"]),
        (["track", "serial-square", "--artifact", "missing.json"], ["missing.json"]),
        (["track", "--trajectory", "missing.json", "--robot", "arm3"], ["missing.json"]),
        (["track", "--trajectory", "missing.json"], ["--robot", "--artifact"]),
        (["track", "--trajectory", "missing.json", "--robot", "arm9"], ["arm9", "arm3"]),
        (["track", "serial-square", "--robot", "arm3"], ["--robot", "--trajectory"]),
        (["track", "serial-square", "--figure-format", "jpeg"], ["jpeg", "png, svg, pdf"]),
        (["log", "info", "LAST", "--figure-format", "svg"], ["--figure-format", "plot"]),
        (["track", "serial-square", "--artifact", "x.json", "--rate-hz", "2000"], ["--rate-hz", "--artifact"]),
        (["hil", "serial-star"], ["serial-star"]),
        (["hil"], ["SCENARIO"]),
        (["inspect", "missing.json"], ["missing.json"]),
        (["inspect", "."], ["directory"]),
        (["inspect"], ["ARTIFACT"]),
        (["paint"], ["paint"]),
        (["list", "--colour"], ["--colour"]),
    ],
)
def test_when_the_command_line_is_wrong_expect_one_line_and_exit_2(
    design: Design, tmp_path: Path, arguments: list[str], mentions: list[str]
) -> None:
    assert_refused(design(*arguments), *mentions)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [["synth", "arm3", "--design", "pid"], ["track", "serial-square", "--json"]])
def test_when_the_output_cannot_be_written_expect_one_line_and_nothing_half_written(
    design: Design, tmp_path: Path, arguments: list[str]
) -> None:
    (tmp_path / "file").touch()
    assert_refused(design(*arguments, "--out", "file/below", *(["--controller", "pid"] * ("track" in arguments))))
    assert not [path for path in tmp_path.iterdir() if path.name not in ("file", "out")]


JUNK = {
    "empty": b"",
    "an executable": b"\x7fELF\x02\x01",
    "half an object": b"{",
    "an endless CBOR map": b"\xbf\xff",
    "null": b"null",
    "random bytes": np.random.default_rng(5).bytes(64),
    "many objects": b"{}" * 1000,
}


@pytest.mark.parametrize("junk", JUNK.values(), ids=JUNK.keys())
def test_when_the_artifact_is_junk_expect_one_line_and_exit_2(design: Design, tmp_path: Path, junk: bytes) -> None:
    (tmp_path / "junk.json").write_bytes(junk)
    assert_refused(design("inspect", "junk.json"), "junk.json")
    assert_refused(design("track", "serial-square", "--artifact", "junk.json"), "junk.json")


def flipped(data: bytes, bit: int) -> bytes:
    damaged = bytearray(data)
    damaged[bit // 8] ^= 1 << (bit % 8)
    return bytes(damaged)


def test_when_any_of_fifty_single_bits_of_an_artifact_is_flipped_expect_one_line_and_exit_2(
    design: Design, tmp_path: Path, artifact: bytes
) -> None:
    rng = np.random.default_rng(11)
    file = tmp_path / "flipped.json"
    for bit in rng.choice(8 * len(artifact), size=50, replace=False):
        file.write_bytes(flipped(artifact, int(bit)))
        assert_refused(design("track", "serial-square", "--artifact", file), "flipped.json")
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("bit", [5, 4000, 20000])
def test_when_a_flipped_artifact_is_given_to_a_real_process_expect_one_line_and_exit_2(
    tmp_path: Path, artifact: bytes, bit: int
) -> None:
    (tmp_path / "flipped.json").write_bytes(flipped(artifact, bit))
    outcome = in_a_process("track", "serial-square", "--artifact", "flipped.json", "--json", cwd=tmp_path)
    assert_refused(outcome, "flipped.json")


def singular(document: dict[str, Any]) -> dict[str, Any]:
    for block in document["law"]["inertia"]["blocks"]:
        block["vertices"] = [[[0.0] * 3] * 3 for _ in block["vertices"]]
    return document


def test_when_the_design_inertia_is_singular_expect_one_line_and_exit_2(
    design: Design, tmp_path: Path, artifact: bytes
) -> None:
    document = singular(parse_document(artifact, "artifact"))
    (tmp_path / "singular.json").write_bytes(canonical_json(with_hash(document)))
    assert_refused(design("track", "serial-square", "--artifact", "singular.json", "--json"), "inertia")


# ---- track -----------------------------------------------------------------------------------------------------------


def test_when_tracked_as_json_expect_the_rows_of_the_interface_and_nothing_else(design: Design, tmp_path: Path) -> None:
    arguments = ("serial-square", "serial-circle", "--controller", "ctc", "--plant", "nominal", "--rate-hz", 500)
    outcome = design("track", *arguments, "--json")
    rows = json.loads(outcome.out)
    assert (outcome.code, outcome.err) == (0, "")
    assert [(row["scenario"], row["controller"]) for row in rows] == [
        ("serial-square", "ctc"),
        ("serial-circle", "ctc"),
    ]
    for row in rows:
        assert list(row) == list(ROW)
        for name, kind in ROW.items():
            assert isinstance(row[name], kind), name
        assert (row["rate_hz"], row["plant"], row["worst_growth_rate_per_s"]) == (500.0, "nominal", None)
        assert row["sensors"] == {"encoder_bits": 20, "velocity_noise_rad_s": 0.05}
    assert json.loads((tmp_path / "out/track/results.json").read_bytes()) == rows
    assert not list(tmp_path.rglob("*.png"))


def test_when_nothing_is_chosen_expect_all_default_controllers_and_a_coarse_encoder_row(
    design: Design, monkeypatch: pytest.MonkeyPatch, artifact: bytes, tmp_path: Path
) -> None:
    (tmp_path / "a.json").write_bytes(artifact)
    wanted: list[Variant] = []

    def instead(_robot: str, variant: Variant, *_options: object, **_more: object) -> Artifact:
        wanted.append(variant)
        return read_artifact(tmp_path / "a.json")

    monkeypatch.setattr("quasilpv.cli.session.designed", instead)
    rows = json.loads(design("track", "serial-square", "--json").out)
    tuned = ("pid", "pid-tuned", "ctc", "ctc-tuned", "ctc-dob", "ctc-dob-tuned")
    expected = [*((name, 20) for name in (*tuned, "dob-torque", "dob-acceleration")), ("dob-acceleration", 17)]
    assert [(variant.controller, variant.encoder_bits) for variant in wanted] == expected
    assert [(row["controller"], row["sensors"]["encoder_bits"]) for row in rows] == expected


def test_when_an_artifact_and_figures_are_asked_for_expect_one_row_and_the_figures(
    design: Design, tmp_path: Path, artifact: bytes
) -> None:
    (tmp_path / "a.json").write_bytes(artifact)
    outcome = design("track", "serial-circle", "--artifact", "a.json", "--figures", "-o", "here")
    assert outcome.code == 0
    assert "pid" in outcome.out
    assert "error" not in outcome.err
    names = {path.name for path in (tmp_path / "here").rglob("*.png")}
    assert names == {"path.png", "errors.png", "torques.png", "velocity.png"}


def test_when_a_path_file_is_followed_expect_its_name_in_the_row(design: Design, tmp_path: Path) -> None:
    line = {"line": {"to": [1.5, -1.7], "duration_s": 1.0}}
    path = {"name": "short", "tool_angle_rad": 0.785, "start": [1.4, -1.7], "segments": [line]}
    (tmp_path / "short.json").write_text(json.dumps(path), encoding="utf-8")
    command = ("track", "--trajectory", "short.json", "--robot", "arm3", "--controller", "ctc", "--json")
    rows = json.loads(design(*command).out)
    assert [row["scenario"] for row in rows] == ["short"]


@pytest.mark.parametrize(
    ("to", "mention"), [([5.0, -1.7], "distance"), ([1.9, 0.9], "short.json"), ([0.6, -0.6], "short.json")]
)
def test_when_a_path_leaves_reach_or_modelling_box_expect_one_line_with_the_reason(
    design: Design, tmp_path: Path, to: list[float], mention: str
) -> None:
    segment = {"line": {"to": to, "duration_s": 1.0}}
    path = {"name": "short", "tool_angle_rad": 0.785, "start": [1.4, -1.7], "segments": [segment]}
    (tmp_path / "short.json").write_text(json.dumps(path), encoding="utf-8")
    command = ("track", "--trajectory", "short.json", "--robot", "arm3", "--controller", "ctc")
    assert_refused(design(*command), mention)


def test_when_a_path_is_followed_expect_the_robot_of_the_artifact_and_never_another(
    design: Design, tmp_path: Path
) -> None:
    path = {"name": "ray", "start": [0.0, -0.22], "segments": [{"line": {"to": [0.02, -0.22], "duration_s": 0.3}}]}
    (tmp_path / "ray.json").write_text(json.dumps(path), encoding="utf-8")
    write_artifact(tmp_path, release(DesignRequest.of("fivebar", "pid")).artifact)
    of_the_artifact = ("track", "--trajectory", "ray.json", "--artifact", "artifact.json")
    (row,) = json.loads(design(*of_the_artifact, "--json").out)
    assert (row["scenario"], row["controller"]) == ("ray", "pid")
    scenario = json.loads((tmp_path / "out/track/ray/pid/scenario.json").read_bytes())
    assert scenario["plant"]["kind"] == "five-bar"
    assert_refused(design(*of_the_artifact, "--robot", "arm3"), "--robot: got arm3, expected fivebar")


# ---- hil and processes -----------------------------------------------------------------------------------------------


def test_when_run_over_lcm_in_lock_step_expect_the_run_in_process(design: Design) -> None:
    outcome = design("hil", "serial-circle", "--controller", "pid-tuned", "--json")
    row = json.loads(outcome.out)
    assert (outcome.code, outcome.err) == (0, "")
    assert row["controller"] == "pid-tuned"  # its law kind is pid
    assert row["mode"] == "lockstep"
    assert row["identical_to_in_process"] is True
    assert {name: row[name] for name in row["in_process"]} == row["in_process"]
    assert sorted(path.name for path in Path().rglob("*.lcmlog")) == ["run.lcmlog"]


def test_when_run_in_real_time_expect_latencies_beside_both_accuracies(design: Design) -> None:
    outcome = design(
        "hil", "serial-circle", "--controller", "ctc", "--real-time", "--silence-s", "5", "--hold-s", "5", "--json"
    )
    row = json.loads(outcome.out)
    assert outcome.code == (0 if row["fault"] is None else 3)
    assert row["mode"] == "realtime"
    assert row["simulator_report"]["wakeup_ns"]["p50"] > 0
    assert row["simulator_report"]["round_trip_ns"]["p99"] >= row["simulator_report"]["round_trip_ns"]["p50"] > 0
    assert row["rms_x_m"] > 0 < row["in_process"]["rms_x_m"]


def test_when_a_fault_stops_a_real_time_run_expect_exit_3_one_line_and_both_reports(design: Design) -> None:
    # No machine answers within the millisecond in every sample of seconds: the watchdogs act.
    watchdogs = ["--silence-s", "0.001", "--hold-s", "0.001"]
    outcome = design("hil", "serial-circle", "--controller", "ctc", "--real-time", *watchdogs, "--json")
    row = json.loads(outcome.out)
    assert outcome.code == 3
    assert outcome.err.splitlines()[-1] == f"error: {row.get('fault', row.get('reason'))}"
    log = read_log(next(Path().rglob("run.lcmlog")))
    assert log.header.mode == "realtime"  # of the run that failed, not of the one in this process
    if "fault" not in row:  # it came before anything could be counted
        return
    latched = row["controller_report"]["post_mortem"]["seq"][-1]
    assert row["fault"] == f"fault F2 at {latched / 1000:.3f} s: plant silent"
    assert row["controller_report"]["fault_cause"] == "plant silent"
    assert 0 < row["samples"] <= latched
    assert row["simulator_report"]["controller_state"] == "fault"
    assert design("log", "info", "LAST", "--json").code == 0


def test_when_the_executables_are_missing_expect_one_line(design: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    assert_refused(design("hil", "serial-circle", "--controller", "ctc"), "qlpv-controller")


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
