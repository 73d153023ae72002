"""The page: a viser server on this machine that shows a playback, or a run as it happens, with its controls."""

from __future__ import annotations

import contextlib
import io
import socket
from collections.abc import Callable
from queue import SimpleQueue

import viser
from viser import uplot

from quasilpv.errors import InputError
from quasilpv.figures.style import JOINT_COLOURS
from quasilpv.view.curves import Curves, curves_of, step_histogram
from quasilpv.view.live import LiveMotion
from quasilpv.view.playback import SPEEDS, Instant, Playback, Player
from quasilpv.view.robot_scene import RobotScene
from quasilpv.view.same_origin import same_origin_only

HOST = "127.0.0.1"
PLOT_PERIOD_S = 0.12
_PANEL_WIDTH = 400
_PLOT_HEIGHT = 104
_AXES = (uplot.Axis(size=26), uplot.Axis(size=60, space=18))
"""Room for labels as wide as "1,000"; on the vertical axis a tick every 18 pixels or more: two at least on a plot."""
_PADDING = (6, 14, 0, 0)
_TIME_STEPS = 1000


class Page:
    """A page, served from creation to `close`; `step` is to be called some thirty times a second.

    Args:
        playback: what is shown; of a live run, what there is of it so far.
        port: on the loopback interface.
        live: where the rest of a live run comes from; None for a run that is over.

    Raises:
        InputError: the port is taken.

    Attributes:
        url: of the page.
        player: its clock.
        scene: what is drawn.
        watched: whether a browser has opened it; a live run is watched from its beginning.
    """

    def __init__(self, playback: Playback, port: int, live: LiveMotion | None = None) -> None:
        """Serve."""
        self._playback, self._live = playback, live
        self._server = _serve(port)
        self.watched = live is not None
        self._server.on_client_connect(self._welcome)
        self.url = f"http://{HOST}:{self._server.get_port()}"
        self.player = Player.of(playback)
        self._actions: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._since_plots_s = PLOT_PERIOD_S
        self._shown: tuple[int, int, bool] | None = None
        gui = self._server.gui
        # Sharing would send the page through a server of others.
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_PANEL_WIDTH)
        gui.set_panel_label(playback.title)
        self.scene = RobotScene(self._server, playback)
        self._add_controls()
        self._curves = curves_of(playback)
        self._plots = [self._add_plot(curves) for curves in self._curves]
        self._histogram = self._add_histogram()
        self.step(0.0)

    def step(self, elapsed_s: float) -> None:
        """Let time pass, do what was clicked, and draw what has changed."""
        while not self._actions.empty():
            self._actions.get()()
        self._since_plots_s += elapsed_s
        if self._live is None:
            self.player.advance(elapsed_s)
        else:
            self._grow(self._live)
        instant = self._playback.at(self.player.time_s)
        shown = (id(self._playback), instant.sample, self.player.playing)
        if shown == self._shown and self._since_plots_s < PLOT_PERIOD_S:
            return
        with self._server.atomic():
            self._draw(instant)
        self._shown = shown

    def close(self) -> None:
        """Serve no more."""
        with _quiet():
            self._server.stop()

    def _welcome(self, client: viser.ClientHandle) -> None:
        self.watched = True
        self.scene.fit(client.camera)

    # ---- drawing ---------------------------------------------------------------------------------------------------

    def _draw(self, instant: Instant) -> None:
        self.scene.show(instant)
        self._play.label = "Pause" if self.player.playing else "Play"
        now_s = min(max(self.player.time_s, self._time.min), self._time.max)
        self._time.value = now_s  # type: ignore[misc]  # mypy does not see its setter
        self._status.content = _status(instant, self.scene.exaggeration)
        if self._share is not None and not self.player.playing:
            self._share.content = f"`design view --log {self._playback.source} --at {instant.time_s:.3f}`"
        if self._since_plots_s >= PLOT_PERIOD_S or not self.player.playing:
            self._since_plots_s = 0.0
            for plot, curves in zip(self._plots, self._curves, strict=True):
                plot.data = curves.until(instant.sample)

    def _grow(self, live: LiveMotion) -> None:
        motion = live.poll()
        if motion is None or motion is self._playback.motion or self._since_plots_s < PLOT_PERIOD_S:
            return
        self._playback = self._playback.with_motion(motion)
        self.player.follow(self._playback.begin_s, self._playback.end_s)
        self._time.min, self._time.max = (
            self._playback.begin_s,
            max(self._playback.end_s, self._playback.begin_s + 1e-3),
        )
        self.scene.show_paths(self._playback)
        self._curves = curves_of(self._playback)
        while len(self._plots) < len(self._curves):
            self._plots.append(self._add_plot(self._curves[len(self._plots)]))
        for plot, curves in zip(self._plots, self._curves, strict=True):
            plot.scales = self._scales(curves)
        histogram = step_histogram(motion.step_us)
        if histogram is not None and self._histogram is not None:
            self._histogram.data = (histogram.edge, histogram.count)
            self._histogram.title = histogram.title

    # ---- controls and plots ----------------------------------------------------------------------------------------

    def _add_controls(self) -> None:
        gui, playback = self._server.gui, self._playback
        self._status = gui.add_markdown("")
        self._play = gui.add_button("Pause")
        self._play.on_click(lambda _: self._actions.put(self.player.toggle))
        end_s = max(playback.end_s, playback.begin_s + 1e-3)
        step = (end_s - playback.begin_s) / _TIME_STEPS
        self._time = gui.add_slider("time (s)", playback.begin_s, end_s, step, playback.begin_s)

        @self._time.on_update
        def _(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
            if event.client is not None:  # moved by hand, not by the clock
                self._actions.put(lambda: self._scrub(event.target.value))

        if self._live is None:
            speed = gui.add_dropdown("speed", [f"{speed:g}" for speed in SPEEDS], initial_value="1")
            speed.on_update(lambda _: self._actions.put(lambda: setattr(self.player, "speed", float(speed.value))))
        with gui.add_folder("show", expand_by_default=False):
            shadow = gui.add_checkbox("robot on its reference", self.scene.show_shadow)
            magnified = gui.add_checkbox("tool path, error magnified", True)
            skeleton = gui.add_checkbox("robot as bars", not playback.meshes)
        self._share: viser.GuiMarkdownHandle | None = None
        if playback.source:
            with gui.add_folder("share", expand_by_default=False):
                gui.add_markdown("Whoever has the file opens this moment with (pause to update):")
                self._share = gui.add_markdown(f"`design view --log {playback.source}`")
        gui.add_html(_legend(playback.motion.angle_rad.shape[1]))

        def show(_: object) -> None:
            self.scene.set_visible(shadow=shadow.value, magnified=magnified.value, skeleton=skeleton.value)

        shadow.on_update(show)
        magnified.on_update(show)
        skeleton.on_update(show)

    def _scrub(self, time_s: float) -> None:
        self.player.playing = False
        self.player.seek(time_s)

    def _scales(self, curves: Curves) -> dict[str, uplot.Scale]:
        begin_s, end_s = self._playback.begin_s, max(self._playback.end_s, self._playback.begin_s + 1e-3)
        return {
            "x": uplot.Scale(time=False, range=(begin_s, end_s)),
            "y": uplot.Scale(range=curves.range),
        }

    def _add_plot(self, curves: Curves) -> viser.GuiUplotHandle:
        dashed = curves.dashed or [False] * len(curves.labels)
        lines = [
            uplot.Series(label=label, stroke=colour, width=1.2, dash=(5.0, 4.0) if is_dashed else ())
            for label, colour, is_dashed in zip(curves.labels, curves.colours, dashed, strict=True)
        ]
        return self._server.gui.add_uplot(
            curves.until(self._playback.motion.samples),
            (uplot.Series(label="t"), *lines),
            title=curves.title,
            scales=self._scales(curves),
            legend=uplot.Legend(show=False),
            height=_PLOT_HEIGHT,
            padding=_PADDING,
            axes=_AXES,
        )

    def _add_histogram(self) -> viser.GuiUplotHandle | None:
        histogram = step_histogram(self._playback.motion.step_us)
        if histogram is None:
            return None
        return self._server.gui.add_uplot(
            (histogram.edge, histogram.count),
            (uplot.Series(label="us"), uplot.Series(label="steps", stroke="#0072B2", fill="#0072B233", width=1.0)),
            title=histogram.title,
            scales={"x": uplot.Scale(time=False)},
            legend=uplot.Legend(show=False),
            height=_PLOT_HEIGHT,
            padding=_PADDING,
            axes=_AXES,
        )


def _serve(port: int) -> viser.ViserServer:
    """A server on the loopback interface, on exactly this port, for pages of this machine; it says nothing itself."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise InputError("command line", "--port", port, f"a free port of {HOST}") from error
        free_port = int(probe.getsockname()[1])
    with _quiet(), same_origin_only():
        return viser.ViserServer(host=HOST, port=free_port, verbose=False)


def _legend(joints: int) -> str:
    """The colours of the joints, which all plots share; premises have the same in their order."""
    names = (f'<span style="color:{JOINT_COLOURS[k]}">&#9632; joint {k + 1}</span>' for k in range(joints))
    return f'<div style="font-size:0.8em; padding:0 1em">{" &nbsp; ".join(names)} &nbsp; over time in s</div>'


def _quiet() -> contextlib.redirect_stdout[io.StringIO]:
    """Keeps what the viewer says of its server from standard output."""
    return contextlib.redirect_stdout(io.StringIO())


def _status(instant: Instant, exaggeration: float) -> str:
    error_um = 1e6 * float((instant.error_m**2).sum()) ** 0.5
    healthy = "healthy" if instant.flags == 0 else f"flags {instant.flags:#b}"
    return (
        f"**{instant.time_s:.3f} s** · controller **{instant.state}**, {healthy} · tool error **{error_um:.1f} µm**"
        f" (orange path: × {exaggeration:g})"
    )
