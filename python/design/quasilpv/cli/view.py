"""``design view``: a run in three dimensions and in plots, on a local web page."""

from __future__ import annotations

import shlex
import sys
import time
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from quasilpv.cli.console import print_note
from quasilpv.cli.logs import LogArtifactOption, open_log
from quasilpv.defaults import DEFAULT_PORT, DEFAULT_URL, LAST
from quasilpv.errors import InputError, TransportError

if TYPE_CHECKING:
    from quasilpv.artifact import Artifact
    from quasilpv.descriptions.meshes import BodyMesh
    from quasilpv.documents.system_artifact import SystemArtifactDocument
    from quasilpv.systems.robots.drawing import Drawing
    from quasilpv.telemetry import RunLog
    from quasilpv.view.live import Live
    from quasilpv.view.plot_page import PlotPage

Shown = TypeVar("Shown")
FRAME_S = 1.0 / 30.0


def view_command(
    *,
    log: Annotated[
        str | None,
        typer.Option("--log", metavar="LOG", help=f"A log, or LAST: that of the last run.  [default: {LAST}]"),
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="Listen to a run instead; needs --artifact.")] = False,
    url: Annotated[str, typer.Option("--url", help="Live: LCM URL of the run.")] = DEFAULT_URL,
    artifact: LogArtifactOption = None,
    scenario: Annotated[
        Path | None,
        typer.Option("--scenario", metavar="FILE", help="Live: whose plant is drawn.  [default: the robot's]"),
    ] = None,
    robot: Annotated[
        Path | None,
        typer.Option("--robot", metavar="FILE", help="A robot.toml: the meshes that its URDF names are shown."),
    ] = None,
    meshes: Annotated[
        list[Path] | None,
        typer.Option("--meshes", metavar="FOLDER", help="Where package:// names lead; may be given several times."),
    ] = None,
    timeout_s: Annotated[
        float, typer.Option("--timeout-s", min=0.0, max=86400.0, help="Live: wait so long for the first sample.")
    ] = 60.0,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Of the page; 0: any free one.")] = DEFAULT_PORT,
    at: Annotated[
        float | None, typer.Option("--at", metavar="SECONDS", help="Stand still at this time instead of playing.")
    ] = None,
    browser: Annotated[
        bool | None, typer.Option("--browser/--no-browser", help="Open a browser.  [default: on a terminal]")
    ] = None,
) -> None:
    """Show a run on a local web page: the robot, its reference, errors, torques, disturbance, premises, step times.

    Pause, scrub, change the speed; drag to turn the scene. Of a general system, live too: its signals, V and step times
    as curves, its phase portraits with the region. The page is served on the loopback interface only, until Ctrl-C.

    \b
    Examples:
      design view --log LAST
      design view --log LAST --robot ur5.toml --meshes ur_description
      design view --live --artifact out/arm3/artifact.json
    """
    from quasilpv.artifact import read_artifact
    from quasilpv.artifact.system_store import read_system_artifact
    from quasilpv.experiments.logged import mechanism_of
    from quasilpv.view.live import LiveMotion
    from quasilpv.view.page import Page
    from quasilpv.view.playback import Motion, Playback

    listener, source = None, ""
    drawn = robot or scenario or next(iter(meshes or []), None)
    if live:
        if artifact is None or log is not None:
            got = "no --artifact" if artifact is None else f"--log {log}"
            raise InputError("command line", "--live", got, "--artifact FILE and no --log")
        system = read_system_artifact(artifact)
        if system is not None:
            _show_live_system(system, url, timeout_s, port, browser, drawn_robot=drawn)
            return
        controller = read_artifact(artifact)
        listener = LiveMotion(url, controller)
        motion, title = _first_samples(listener, url, timeout_s), f"live: {controller.name}"
        mechanism = _mechanism(controller, scenario)
    else:
        recorded = open_log(log or LAST, artifact)
        if recorded.is_of_system:
            _show_system(recorded, port, at, browser, drawn_robot=drawn)
            return
        controller, motion = recorded.artifact, Motion.of_log(recorded)
        mechanism = mechanism_of(recorded.scenario.plant)
        title, source = f"{recorded.scenario.name}, {recorded.header.controller}", shlex.quote(recorded.source)
    bodies = _bodies(robot, meshes or [], mechanism)
    playback = Playback(title, motion, mechanism, _disturbance_unit(controller), source, bodies)
    _serve(Page(playback, port, listener), at, browser)


def _show_system(log: RunLog, port: int, at: float | None, browser: bool | None, *, drawn_robot: Path | None) -> None:
    from quasilpv.view.system_page import SystemPage, SystemTimeline

    _refuse_drawn(drawn_robot)
    _serve(SystemPage(SystemTimeline.of_log(log, shlex.quote(log.source)), port), at, browser)


def _show_live_system(
    artifact: SystemArtifactDocument,
    url: str,
    timeout_s: float,
    port: int,
    browser: bool | None,
    *,
    drawn_robot: Path | None,
) -> None:
    from quasilpv.view.system_page import LiveTimeline, SystemPage

    _refuse_drawn(drawn_robot)
    listener = LiveTimeline(url, artifact)
    _serve(SystemPage(_first_samples(listener, url, timeout_s), port, listener), None, browser)


def _refuse_drawn(drawn_robot: Path | None) -> None:
    if drawn_robot is not None:
        expected = "a log or an artifact of a robot: a system is shown as curves and phase portraits"
        raise InputError("command line", "--robot, --meshes or --scenario", str(drawn_robot), expected)


def _serve(page: PlotPage, at: float | None, browser: bool | None) -> None:
    if at is not None:
        page.player.playing = False
        page.player.seek(at)
    print(page.url, flush=True)
    if sys.stdout.isatty() if browser is None else browser:
        webbrowser.open(page.url)
    print_note("Ctrl-C ends the view")
    _run(page)


def _bodies(robot: Path | None, folders: list[Path], mechanism: Drawing) -> tuple[BodyMesh, ...]:
    from quasilpv.descriptions.meshes import body_meshes
    from quasilpv.descriptions.robot_file import read_robot_file
    from quasilpv.systems.robots.tree_mechanism import TreeMechanism

    if robot is None:
        if folders:
            raise InputError("command line", "--meshes", str(folders[0]), "--robot FILE beside it")
        return ()
    source = read_robot_file(robot)
    names = [joint.name for joint in source.robot().joints]
    moved = [joint.name for joint in mechanism.tree.joints] if isinstance(mechanism, TreeMechanism) else []
    if names != moved:
        raise InputError(
            str(robot), "joints", ", ".join(names), f"those of the run: {', '.join(moved) or 'of a plane'}"
        )
    found, missing = body_meshes(source, folders)
    if missing:
        print_note(f"{len(missing)} meshes are not there or not STL or OBJ, the first is {missing[0]}")
    return tuple(found)


def _run(page: PlotPage) -> None:
    last = time.monotonic()
    try:
        while True:
            time.sleep(FRAME_S)
            now = time.monotonic()
            page.step(now - last if page.watched else 0.0)
            last = now
    except KeyboardInterrupt:
        page.close()


def _first_samples(listener: Live[Shown], url: str, timeout_s: float) -> Shown:
    deadline = time.monotonic() + timeout_s
    print_note(f"waiting for telemetry on {url}")
    while (shown := listener.poll()) is None:
        if time.monotonic() > deadline:
            heard = (
                ", ".join(f"{count} of {reason}" for reason, count in listener.refused.items() if count) or "nothing"
            )
            raise TransportError(f"{url}: no telemetry of this artifact within {timeout_s:g} s; heard {heard}")
        time.sleep(FRAME_S)
    return shown


def _mechanism(controller: Artifact, scenario: Path | None) -> Drawing:
    from quasilpv.experiments.logged import mechanism_of
    from quasilpv.scenarios import read_scenario
    from quasilpv.systems.robots.registry import any_robot

    return any_robot(controller.robot.id).model if scenario is None else mechanism_of(read_scenario(scenario).plant)


def _disturbance_unit(controller: Artifact) -> str:
    return "rad/s²" if controller.law.DISTURBANCE == "acceleration" else "N m"
