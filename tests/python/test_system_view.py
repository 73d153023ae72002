"""General systems as they are seen: curves and phase portraits on a page, and in an animation."""

from __future__ import annotations

import json
import secrets
import time
import urllib.request
from pathlib import Path

import lcm
import numpy as np
import pytest
from PIL import Image, ImageChops

from quasilpv.artifact import write_artifact
from quasilpv.artifact.system_store import write_system_artifact
from quasilpv.cli.app import run
from quasilpv.experiments.system_logged import write_log
from quasilpv.experiments.system_run import SystemExperiment, SystemRun, simulate
from quasilpv.figures.animation import FRAMES_PER_SECOND
from quasilpv.figures.phase import LONGEST_S, SHORTEST_S, PhasePortrait, write_phase_animation
from quasilpv.release import release
from quasilpv.scenarios.system_schema import ConstantDisturbance
from quasilpv.synthesis import DesignRequest
from quasilpv.telemetry import LOG_NAME, read_log
from quasilpv.telemetry.message_types import channel_type
from quasilpv.telemetry.system_recording import TELEMETRY, system_messages
from quasilpv.view.plot_page import HOST
from quasilpv.view.system_page import LiveTimeline, SystemPage, SystemTimeline, on_white, system_curves
from reference.released_systems import released

PATIENCE_S = 20.0


@pytest.fixture(scope="module")
def seen() -> SystemRun:
    return simulate(released("dc-bus"), SystemExperiment({"v": 8.0}, {}, noise={"v": 0.2}), "test")


@pytest.fixture
def timeline(seen: SystemRun, tmp_path: Path) -> SystemTimeline:
    return SystemTimeline.of_log(read_log(write_log(tmp_path / LOG_NAME, seen)), "run.lcmlog")


def test_curves_are_the_signals_with_what_was_measured_their_near_limits_and_v(
    timeline: SystemTimeline, seen: SystemRun
) -> None:
    i, v, j, u, level = system_curves(timeline)
    assert [list(each.labels) for each in (i, j, u)] == [["i"], ["j"], ["u"]]
    assert list(v.labels) == ["measured", "v", "lower limit", "upper limit"]
    assert [bool(dashed) for dashed in v.dashed] == [False, False, True, True]
    names = [signal.name for signal in seen.artifact.states]
    np.testing.assert_array_equal(v.values[:, 0], seen.measured[v.rows, names.index("v")])
    np.testing.assert_array_equal(v.values[:, 1], seen.state[v.rows, names.index("v")])
    limits = seen.artifact.states[names.index("v")]
    assert set(v.values[:, 2:].ravel()) == {limits.low, limits.high}
    np.testing.assert_allclose(10.0 ** level.values[:, 0], np.maximum(seen.level[v.rows], 1e-12), rtol=1e-9)
    assert np.all(level.values[:, 1] == 0.0)


def test_the_point_of_a_phase_portrait_is_where_the_state_is(seen: SystemRun) -> None:
    portrait = PhasePortrait(seen)
    names = [signal.name for signal in seen.artifact.states]
    axis = {name: seen.state[:, names.index(name)] for name in ("i", "v")}

    def centre(sample: int) -> tuple[float, float]:
        """Of what the last step of the run added to the picture: the point, and a short piece of its way."""
        still = PhasePortrait(seen).frame(0).crop((0, 30, 770, 363))  # without the text
        change = np.asarray(ImageChops.difference(portrait.frame(sample).crop((0, 30, 770, 363)), still)).max(axis=2)
        rows, columns = np.nonzero(change[:, :] > 60)
        return float(columns.min()), float(rows.max())

    low_i = int(np.argmin(axis["i"]))
    left, _ = centre(low_i)
    _, bottom = centre(len(seen.time_s) - 1)
    assert left < centre(2)[0]  # i falls: further left
    assert bottom > centre(low_i)[1]  # v falls: further down


def test_an_animation_lasts_some_seconds_however_short_or_long_the_run_is(seen: SystemRun, tmp_path: Path) -> None:
    frames, speed = write_phase_animation(seen, tmp_path / "phase.gif")
    assert SHORTEST_S <= frames / FRAMES_PER_SECOND <= LONGEST_S
    assert speed * frames / FRAMES_PER_SECOND == pytest.approx(seen.time_s[-1])
    with Image.open(tmp_path / "phase.gif") as film:
        assert getattr(film, "n_frames", 1) > 0.5 * frames  # equal frames are one
        first = np.asarray(film.convert("RGB")).astype(int)
        film.seek(film.n_frames - 1)  # type: ignore[attr-defined]
        last = np.asarray(film.convert("RGB")).astype(int)
    moved = np.abs(first - last).max(axis=2) > 60
    assert 1e-4 < moved.mean() < 0.05


def test_a_picture_fills_its_space_without_being_stretched() -> None:
    picture = Image.new("RGB", (200, 100), "black")
    for aspect in (0.5, 2.0, 3.7):
        framed = on_white(picture, aspect)
        assert framed.width / framed.height == pytest.approx(aspect, rel=0.02)
        assert np.count_nonzero(np.asarray(framed.convert("L")) == 0) == 200 * 100


def test_the_page_of_a_system_is_served_on_the_loopback_interface_only_and_follows_its_clock(
    timeline: SystemTimeline,
) -> None:
    page = SystemPage(timeline, 0)
    try:
        with urllib.request.urlopen(page.url, timeout=PATIENCE_S) as answer:
            assert answer.status == 200
        assert page.url.startswith(f"http://{HOST}:")
        assert page.player.speed < 1.0  # the run is short
        page.step(0.1)
        assert page.player.time_s == pytest.approx(0.1 * page.player.speed)
        page.step(1e3)
        assert not page.player.playing
        assert page.player.time_s == timeline.end_s
    finally:
        page.close()


def test_animate_takes_the_artifact_of_a_system_and_what_does_not_go_with_it_is_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    path = str(write_system_artifact(tmp_path / "made", released("dc-bus"))[0])
    assert run(["animate", path, "--start", "v=8", "--duration", "0.01", "-o", "out", "--no-figures", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert Path(answer["animation"]).exists()
    assert answer["frames"] == answer["samples"]  # fewer than fill its shortest length
    assert {entry.name for entry in Path(answer["animation"]).parent.iterdir()} == {"phase.gif", LOG_NAME}
    robot, _ = write_artifact(tmp_path / "robot", release(DesignRequest.of("arm2", "pid")).artifact)
    for arguments, words in (
        ([path, path], "one artifact of a system alone"),
        ([path, "--rate-hz", "1000"], "--rate-hz"),
        ([path, "--plant", "nominal"], "--plant"),
        ([path, "--encoder-bits", "12"], "--encoder-bits"),
        ([path, "--noise", "q=1"], "noise: got q"),
        (["serial-square", "--start", "v=8"], "--start"),
        ([str(robot)], "one of a system"),
    ):
        assert run(["animate", *arguments]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert words in said


def test_a_system_is_shown_as_it_runs() -> None:
    pushed = ConstantDisturbance(signal="v", value=2000.0, begin_s=0.05)
    seen = simulate(released("dc-bus"), SystemExperiment({}, {}, 0.1, disturbances=(pushed,)), "test")
    artifact = seen.artifact
    url = f"udpm://239.255.76.67:{49152 + secrets.randbelow(16384)}?ttl=0"
    wire, live = lcm.LCM(url), LiveTimeline(url, artifact)
    seq = np.arange(len(seen.time_s))
    columns = {name: getattr(seen, name) for name in ("measured", "input", "commanded", "premise")}
    records = system_messages(TELEMETRY, artifact, seq, columns)
    records["level"] = seen.measured_level
    lost = 40
    records["measured"][lost] = np.nan
    packets = list(channel_type(TELEMETRY).encode(records))

    def heard(count: int) -> SystemTimeline:
        deadline = time.monotonic() + PATIENCE_S
        while (shown := live.poll()) is None or len(shown.run.time_s) < count:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        return shown

    def send(first: int, last: int) -> None:
        for packet in packets[first:last]:
            wire.publish(TELEMETRY, packet)

    page = None
    try:
        send(0, 30)
        page = SystemPage(heard(30), 0, live)
        before = [list(curves.labels) for curves in page._curves]
        send(30, len(packets))
        shown = heard(len(packets))
        np.testing.assert_array_equal(shown.run.input, seen.input)
        np.testing.assert_array_equal(shown.run.level, seen.measured_level)
        np.testing.assert_array_equal(shown.run.state[lost], seen.measured[lost - 1])
        page.step(1.0)
        assert page.player.end_s == pytest.approx(seen.time_s[-1])
        assert page.player.time_s == page.player.end_s
        labels = [list(curves.labels) for curves in system_curves(shown)]
        assert [list(curves.labels) for curves in page._curves] == labels != before  # the limits have come near
        assert len(page._plots) == len(page._curves)
    finally:
        live.close()
        if page is not None:
            page.close()


def test_view_draws_no_robot_beside_a_system(
    seen: SystemRun, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_log(tmp_path / LOG_NAME, seen)
    assert run(["view", "--log", str(path), "--robot", "ur5.toml"]) == 2
    assert "a system is shown as curves" in capsys.readouterr().err
    artifact = write_system_artifact(tmp_path / "made", seen.artifact)[0]
    assert run(["view", "--live", "--artifact", str(artifact), "--robot", "ur5.toml"]) == 2
    assert "a system is shown as curves" in capsys.readouterr().err
