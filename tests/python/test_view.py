"""The live view: states of a run over time, the clock that plays it, live telemetry, and the page in a real browser."""

from __future__ import annotations

import secrets
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import lcm
import numpy as np
import pytest
import viser
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from screenshot import HEIGHT, WIDTH, take_screenshot

from quasilpv.artifact import Artifact, write_artifact
from quasilpv.cli import run
from quasilpv.errors import InputError
from quasilpv.experiments.logged import mechanism_of
from quasilpv.experiments.setup import RunSetup
from quasilpv.experiments.track import track
from quasilpv.release import release
from quasilpv.scenarios import Sensors, TrackingExperiment
from quasilpv.synthesis import DesignRequest, Specification
from quasilpv.systems.robots.registry import robot
from quasilpv.telemetry import LOG_NAME, RunLog, read_log
from quasilpv.telemetry.message_types import message_type
from quasilpv.trajectories import serial_square
from quasilpv.view.curves import curves_of, step_histogram
from quasilpv.view.live import LiveMotion
from quasilpv.view.page import HOST, Page
from quasilpv.view.playback import Motion, Playback, Player

ARM = robot("arm3")
TELEMETRY = message_type("telemetry_v2")
PATIENCE_S = 30.0


@pytest.fixture(scope="module")
def artifact() -> Artifact:
    return release(DesignRequest.of("arm3", "ctc-dob", Specification())).artifact


@pytest.fixture(scope="module")
def log(artifact: Artifact, tmp_path_factory: pytest.TempPathFactory) -> RunLog:
    """The arm draws the square."""
    folder = tmp_path_factory.mktemp("view")
    experiment = TrackingExperiment("square", ARM, serial_square(ARM.model))
    track(RunSetup(experiment, artifact, plant="perturbed", sensors=Sensors()), folder)
    return read_log(folder / LOG_NAME)


@pytest.fixture(scope="module")
def playback(log: RunLog) -> Playback:
    return Playback("square", Motion.of_log(log), mechanism_of(log.scenario.plant), "N m")


def test_when_a_time_is_asked_for_expect_the_robot_where_the_plant_was(playback: Playback, log: RunLog) -> None:
    truth, told = log["truth"].samples, log["telemetry"].samples
    for k in (0, 1, 1234, 2999):
        instant = playback.at(1e-3 * k + 0.4e-3)
        assert (instant.sample, instant.time_s) == (k, pytest.approx(1e-3 * k))
        np.testing.assert_array_equal(instant.links_m, ARM.model.skeleton(truth["angle_rad"][k][:3]))
        np.testing.assert_array_equal(instant.reference_links_m, ARM.model.skeleton(told["reference_angle_rad"][k][:3]))
        np.testing.assert_allclose(instant.error_m, instant.links_m[-1] - instant.reference_links_m[-1], atol=1e-15)
        assert (instant.state, instant.flags) == ("running", told["flags"][k])


def test_when_a_time_is_outside_the_run_expect_its_first_or_last_sample(playback: Playback) -> None:
    assert playback.at(-1.0).sample == 0
    assert playback.at(1e3).sample == playback.motion.samples - 1


def test_when_the_truth_is_not_in_the_log_expect_measured_angles_and_no_disturbance(log: RunLog) -> None:
    blind = replace(
        log, channels={**log.channels, "QLPV_TRUTH": replace(log["truth"], records=log["truth"].records[:0])}
    )
    motion = Motion.of_log(blind)
    np.testing.assert_array_equal(motion.angle_rad, log["measurement"].samples["angle_rad"][:, :3])
    assert np.all(np.isnan(motion.disturbance))
    assert not np.any(np.isnan(Motion.of_log(log).disturbance))


def test_when_premises_are_shown_as_weights_expect_them_between_the_ends_of_their_box(
    playback: Playback, log: RunLog, artifact: Artifact
) -> None:
    weight, table = playback.motion.weight, artifact.law.inertia
    assert np.all((weight >= 0.0) & (weight <= 1.0))
    lower, upper = np.array(table.lower), np.array(table.upper)
    angle = log["measurement"].samples["angle_rad"]
    premises = np.cos([angle[:, 1], angle[:, 2], angle[:, 1] + angle[:, 2]]).T
    np.testing.assert_allclose(lower + weight * (upper - lower), np.clip(premises, lower, upper), atol=1e-14)


def test_when_the_log_holds_no_telemetry_of_this_version_expect_a_line(log: RunLog) -> None:
    empty = replace(log["telemetry"], records=log["telemetry"].records[:0], refused={"wrong size": 7})
    with pytest.raises(InputError, match="7 of wrong size"):
        Motion.of_log(replace(log, channels={**log.channels, "QLPV_TELEMETRY": empty}))


def test_when_the_clock_plays_expect_speed_end_and_a_new_beginning() -> None:
    player = Player(1.0, 3.0, 1.0, speed=0.5)
    player.advance(2.0)
    assert (player.time_s, player.playing) == (2.0, True)
    player.advance(5.0)
    assert (player.time_s, player.playing) == (3.0, False)
    player.advance(5.0)
    assert player.time_s == 3.0
    player.toggle()
    assert (player.time_s, player.playing) == (1.0, True)
    player.toggle()
    player.advance(1.0)
    assert (player.time_s, player.playing) == (1.0, False)


def test_when_a_live_run_grows_expect_the_clock_at_its_end_unless_it_stands() -> None:
    player = Player(0.0, 1.0, 1.0)
    player.follow(0.5, 2.0)
    assert player.time_s == 2.0
    player.playing = False
    player.follow(1.0, 3.0)
    assert player.time_s == 2.0
    player.follow(2.5, 4.0)
    assert player.time_s == 2.5


@given(st.lists(st.tuples(st.sampled_from(["advance", "seek", "toggle"]), st.floats(-10.0, 10.0)), max_size=20))
def test_whatever_is_done_to_the_clock_expect_it_within_the_run(actions: list[tuple[str, float]]) -> None:
    player = Player(0.0, 2.0, 0.0)
    for action, value in actions:
        if action == "toggle":
            player.toggle()
        else:
            getattr(player, action)(abs(value) if action == "advance" else value)
        assert 0.0 <= player.time_s <= 2.0


def test_when_curves_are_cut_at_a_sample_expect_what_was_until_then(playback: Playback) -> None:
    error, torque, disturbance, weights = curves_of(playback)
    assert [len(curves.labels) for curves in (error, torque, disturbance, weights)] == [3, 3, 6, 3]
    time_s, *columns = torque.until(1500)
    assert len(columns) == 3
    assert 0.0 <= time_s[0] < time_s[-1] <= 1.5 < time_s[-1] + 3.0 / len(torque.rows) + 0.01
    np.testing.assert_array_equal(columns[1], playback.motion.torque_nm[torque.rows[: time_s.size], 1])
    assert len(torque.until(0)[0]) == 1
    low, high = torque.range
    assert low < torque.values.min() <= torque.values.max() < high
    assert disturbance.dashed == [False] * 3 + [True] * 3
    watched = replace(playback.motion, lyapunov_rad2=np.square(playback.motion.time_s))
    assert [len(curves.labels) for curves in curves_of(playback.with_motion(watched))] == [3, 3, 6, 3, 1]
    unknown = playback.with_motion(replace(playback.motion, disturbance=np.full_like(playback.motion.estimate, np.nan)))
    assert len(curves_of(unknown)[2].labels) == 3


def test_when_steps_were_timed_expect_their_histogram_and_otherwise_none(playback: Playback) -> None:
    assert step_histogram(playback.motion.step_us) is None
    times = np.array([0.0, 1.0, 1.0, 2.0, 4.0])
    histogram = step_histogram(times)
    assert histogram is not None
    assert histogram.edge.shape == histogram.count.shape
    assert histogram.count[1:-1:2].sum() == 3  # the slowest of few is beyond the last edge
    assert np.all(np.diff(histogram.edge) >= 0.0)
    assert histogram.count[0] == histogram.count[-1] == 0.0


class Telemetry:
    """A sender of telemetry, and what it has sent."""

    def __init__(self, log: RunLog) -> None:
        self.url = f"udpm://239.255.76.67:{49152 + secrets.randbelow(16384)}?ttl=0"
        self._wire = lcm.LCM(self.url)
        self._packets = TELEMETRY.record.newbyteorder(">")
        self._records = log["telemetry"].samples

    def send(self, rows: slice, **members: int) -> None:
        records = self._records[rows].astype(TELEMETRY.record)
        for name, value in members.items():
            records[name] = value
        for packet in TELEMETRY.encode(records):
            self._wire.publish("QLPV_TELEMETRY", packet)


@pytest.fixture
def sender(log: RunLog) -> Telemetry:
    return Telemetry(log)


@pytest.fixture
def live(sender: Telemetry, artifact: Artifact) -> Iterator[LiveMotion]:
    made = LiveMotion(sender.url, artifact)
    yield made
    made.close()


def polled(live: LiveMotion, samples: int) -> Motion:
    """The motion once it has so many samples."""
    deadline = time.monotonic() + PATIENCE_S
    while (motion := live.poll()) is None or motion.samples != samples:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return motion


def test_when_telemetry_arrives_in_parts_expect_the_motion_of_all_of_it(
    sender: Telemetry, live: LiveMotion, log: RunLog, artifact: Artifact
) -> None:
    assert live.poll() is None
    sender.send(slice(0, 10))
    polled(live, 10)
    sender.send(slice(5, 25))
    motion = polled(live, 25)
    expected = Motion.of_telemetry(log["telemetry"].samples[:25], artifact)
    np.testing.assert_array_equal(motion.angle_rad, expected.angle_rad)
    np.testing.assert_array_equal(motion.weight, expected.weight)
    np.testing.assert_array_equal(motion.time_s, 1e-3 * np.arange(25))


def test_when_another_artifact_speaks_or_a_new_session_begins_expect_the_one_left_alone_and_the_other_shown(
    sender: Telemetry, live: LiveMotion
) -> None:
    sender.send(slice(0, 10))
    polled(live, 10)
    sender.send(slice(10, 13), artifact_hash=1)
    sender.send(slice(0, 4), session=99)
    assert polled(live, 4).time_s[-1] == pytest.approx(3e-3)
    assert live.refused == {"other artifact": 3}


def test_when_a_live_run_is_long_expect_only_its_last_seconds_kept(
    sender: Telemetry, live: LiveMotion, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("quasilpv.view.live.WINDOW_S", 0.5)
    sender.send(slice(0, 1000))
    polled(live, 501)
    sender.send(slice(1000, 3000))
    kept = polled(live, 501)
    while kept.time_s[-1] < 2.999:
        kept = polled(live, 501)
    assert (kept.time_s[0], kept.time_s[-1]) == (pytest.approx(2.499), pytest.approx(2.999))


def test_the_page_is_served_on_the_loopback_interface_only_and_follows_its_clock(playback: Playback) -> None:
    page = Page(playback, 0)
    try:
        with urllib.request.urlopen(page.url, timeout=PATIENCE_S) as answer:
            assert answer.status == 200
            assert b"<html" in answer.read().lower()
        port = int(page.url.rpartition(":")[2])
        # Another address of every machine, and of no name service: a page served on all interfaces would answer there.
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", port), timeout=PATIENCE_S)
        with pytest.raises(InputError, match="--port"):
            Page(playback, port)
        assert not page.watched  # the command lets no time pass before a browser is there
        page.step(0.5)
        page.step(0.25)
        assert page.player.time_s == pytest.approx(0.75)
    finally:
        page.close()
    assert page.url.startswith(f"http://{HOST}:")


class Camera:
    """What is asked of a browser's camera."""

    def __init__(self, aspect: float) -> None:
        self.aspect = aspect
        self.position = self.look_at = np.zeros(3)


def test_on_a_screen_that_is_higher_than_wide_expect_the_robot_above_the_controls(playback: Playback) -> None:
    page = Page(playback, 0)
    try:
        wide, high = Camera(1.6), Camera(0.5)
        for camera in (wide, high):
            page.scene.fit(camera)
    finally:
        page.close()
    assert not np.any(wide.position)
    forward = (high.look_at - high.position) / np.linalg.norm(high.look_at - high.position)
    for point in np.column_stack([*playback.at(0.0).links_m.T]):
        seen = np.array([point[0], 0.0, point[1]]) - high.position
        assert seen @ forward > 0.0
        up = np.array([0.0, 0.0, 1.0]) - forward[2] * forward
        assert seen @ up > 0.0  # above the middle of the screen, where the controls end


WEBSOCKET = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}",
}
OWN = ("127.0.0.1:{port}", "localhost:{port}", "LOCALHOST:{port}", "[::1]:{port}", "localhost", "localhost:9")
FOREIGN_HOSTS = (
    "evil.example",
    "evil.example:{port}",
    "127.0.0.1.evil.example:{port}",
    "localhost.evil.example",
    "127.0.0.1@evil.example",
    "127.0.0.2:{port}",
    "0.0.0.0:{port}",
    "localhost:{port}:1",
    "localhost:port",
    "",
)
FOREIGN_ORIGINS = (
    "null",
    "",
    "http://evil.example",
    "https://127.0.0.1:{port}",
    "http://127.0.0.1:1",
    "http://127.0.0.1",
    "http://localhost:{port}",
    "http://127.0.0.1:{port}.evil.example",
    "http://127.0.0.1:{port}/",
    "file://",
)


@pytest.fixture(scope="module")
def port(playback: Playback) -> Iterator[int]:
    page = Page(playback, 0)
    yield int(page.url.rpartition(":")[2])
    page.close()


def status(port: int, headers: Sequence[tuple[str, str]]) -> int:
    """The status that the page answers a request with."""
    lines = ["GET / HTTP/1.1", *(f"{name}: {value.format(port=port)}" for name, value in headers), "", ""]
    with socket.create_connection((HOST, port), timeout=PATIENCE_S) as connection:
        connection.sendall("\r\n".join(lines).encode())
        return int(connection.recv(64).split()[1])


@pytest.mark.parametrize("kind", [{}, WEBSOCKET], ids=["http", "websocket"])
def test_when_another_page_asks_expect_it_refused(kind: dict[str, str], port: int) -> None:
    own, rest = ("Host", OWN[0]), list(kind.items())
    welcome = 101 if kind else 200
    for host in OWN:
        assert status(port, [("Host", host), *rest]) == welcome, host
        assert status(port, [("Host", host), ("Origin", f"http://{host}"), *rest]) == welcome, host
    for host in FOREIGN_HOSTS:
        assert status(port, [("Host", host), *rest]) == 403, host
        assert status(port, [("Host", host), ("Origin", f"http://{host}"), *rest]) == 403, host
    for origin in FOREIGN_ORIGINS:
        assert status(port, [own, ("Origin", origin), *rest]) == 403, origin
    assert status(port, rest) == 403
    assert status(port, [own, ("Host", "evil.example"), *rest]) == 403
    assert status(port, [own, ("Origin", f"http://{OWN[0]}"), ("Origin", "http://evil.example"), *rest]) == 403


def test_when_a_live_run_goes_on_expect_the_page_at_its_end_until_it_is_paused(
    sender: Telemetry, live: LiveMotion, playback: Playback
) -> None:
    sender.send(slice(0, 50))
    page = Page(playback.with_motion(polled(live, 50)), 0, live)
    try:
        for paused, end_s in ((False, 0.099), (True, 0.149)):
            page.step(1.0)
            assert page.player.playing
            page.player.playing = not paused
            rows = round(1e3 * end_s) + 1
            sender.send(slice(rows - 50, rows))
            polled(live, rows)
            page.step(1.0)
            assert page.player.end_s == pytest.approx(end_s)
            assert page.player.time_s == pytest.approx(0.099)
    finally:
        page.close()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--log", "missing.lcmlog"], "missing.lcmlog"),
        (["--live"], "--artifact"),
        (["--live", "--artifact", "missing.json"], "missing.json"),
        (["--live", "--artifact", "ARTIFACT", "--url", "tcpq://here"], "--url"),
        (["--live", "--artifact", "ARTIFACT", "--log", "LAST"], "--log"),
        (["--port", "99999"], "--port"),
    ],
)
def test_when_the_command_line_is_wrong_expect_exit_2_and_one_line(
    arguments: list[str], word: str, artifact: Artifact, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, _ = write_artifact(tmp_path, artifact)
    assert run(["view", *(str(path) if word_ == "ARTIFACT" else word_ for word_ in arguments)]) == 2
    errors = capsys.readouterr().err
    assert len(errors.splitlines()) == 1
    assert word in errors


def test_when_nobody_speaks_expect_exit_5_and_one_line(
    sender: Telemetry, artifact: Artifact, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, _ = write_artifact(tmp_path, artifact)
    assert run(["view", "--live", "--artifact", str(path), "--url", sender.url, "--timeout-s", "0.1"]) == 5
    assert "no telemetry of this artifact" in capsys.readouterr().err.splitlines()[-1]


def test_when_a_browser_opens_the_page_expect_to_see_the_robot_its_path_and_the_plots(
    log: RunLog, tmp_path: Path
) -> None:
    if shutil.which("chromium") is None:
        pytest.skip("chromium is not installed")
    command = [sys.executable, "-m", "quasilpv", "view", "--log", log.source, "--at", "1.9", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            take_screenshot(process.stdout.readline().strip(), tmp_path / "page.png")
        finally:
            process.terminate()
    picture = np.asarray(Image.open(tmp_path / "page.png").convert("RGB")).astype(int)
    assert picture.shape == (HEIGHT, WIDTH, 3)
    scene, panel = picture[:, : int(0.74 * WIDTH)], picture[:, int(0.77 * WIDTH) :]

    def share(part: np.ndarray, is_colour: np.ndarray) -> float:
        return float(np.count_nonzero(is_colour) / is_colour.size)

    red, green, blue = np.moveaxis(scene, 2, 0)
    assert 0.005 < share(scene, (blue > red + 60) & (blue > 90)) < 0.3  # links
    assert share(scene, (red > blue + 80) & (red > green + 40)) > 1e-4  # the path with the error magnified
    assert share(scene, (red > 240) & (green > 240) & (blue > 240)) > 0.4  # background
    saturated = panel.max(axis=2) - panel.min(axis=2) > 80
    assert 0.002 < share(panel, saturated) < 0.5  # curves and the button
    assert saturated[HEIGHT // 4 :].any(axis=1).mean() > 0.2  # curves down the panel
