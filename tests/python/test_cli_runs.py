"""The verbs that run a closed loop: what `design track` and `design hil` print, and the files they leave."""

from __future__ import annotations

import json
from pathlib import Path
from types import NoneType

import pytest

from command import Design, assert_refused
from quasilpv.artifact import Artifact, read_artifact, write_artifact
from quasilpv.experiments.result import Variant
from quasilpv.release import release
from quasilpv.synthesis import DesignRequest
from quasilpv.telemetry import read_log

pytest_plugins = ["command"]

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


# ---- hil -------------------------------------------------------------------------------------------------------------


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
