"""A page of curves over time: a viser server on this machine with a clock, its controls, and plots that follow it."""

from __future__ import annotations

import contextlib
import io
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable
from queue import SimpleQueue
from typing import Protocol

import viser
from viser import uplot

from quasilpv.arrays import FloatArray
from quasilpv.errors import InputError
from quasilpv.view.curves import Curves, step_histogram
from quasilpv.view.playback import SPEEDS, Player
from quasilpv.view.same_origin import same_origin_only

HOST = "127.0.0.1"
PLOT_PERIOD_S = 0.12
_PANEL_WIDTH = 400
_PLOT_HEIGHT = 104
_AXES = (uplot.Axis(size=26), uplot.Axis(size=60, space=18))
"""Room for labels as wide as "1,000"; on the vertical axis a tick every 18 pixels or more: two at least on a plot."""
_PADDING = (6, 14, 0, 0)
_TIME_STEPS = 1000


class Timeline(Protocol):
    """What a page shows over time."""

    @property
    def title(self) -> str:
        """Of the run."""

    @property
    def source(self) -> str:
        """Name of the log, as others may have it; empty of a live run."""

    @property
    def begin_s(self) -> float:
        """Time of the first sample."""

    @property
    def end_s(self) -> float:
        """Time of the last sample."""

    @property
    def step_us(self) -> FloatArray:
        """Time of every control step; 0 where none was measured."""

    def sample_at(self, time_s: float) -> int:
        """Index of the last sample that is not later than a time."""


class PlotPage(ABC):
    """A page, served from creation to `close`; `step` is to be called some thirty times a second.

    Args:
        shown: what is shown.
        port: on the loopback interface.
        live: whether it grows, so that its clock has no speed.

    Raises:
        InputError: the port is taken.

    Attributes:
        url: of the page.
        player: its clock.
        watched: whether a browser has opened it; a live run is watched from its beginning.
    """

    def __init__(self, shown: Timeline, port: int, *, live: bool = False) -> None:
        """Serve; `show_first` draws."""
        self._timeline, self._is_live = shown, live
        self._server = _serve(port)
        self.watched = live
        self._server.on_client_connect(self._welcome)
        self.url = f"http://{HOST}:{self._server.get_port()}"
        self.player = Player(shown.begin_s, shown.end_s, shown.begin_s)
        self._actions: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._since_plots_s = PLOT_PERIOD_S
        self._drawn: tuple[int, int, bool] | None = None
        gui = self._server.gui
        # Sharing would send the page through a server of others.
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(_PANEL_WIDTH)
        gui.set_panel_label(shown.title)

    def show_first(self) -> None:
        """Add controls and plots, and draw the beginning."""
        self._add_controls()
        self._curves = self._curves_now()
        self._plots = [self._add_plot(curves) for curves in self._curves]
        self._histogram = self._add_histogram()
        self.step(0.0)

    def step(self, elapsed_s: float) -> None:
        """Let time pass, do what was clicked, and draw what has changed."""
        while not self._actions.empty():
            self._actions.get()()
        self._since_plots_s += elapsed_s
        self._pass_time(elapsed_s)
        sample = self._timeline.sample_at(self.player.time_s)
        drawn = (id(self._timeline), sample, self.player.playing)
        if drawn == self._drawn and self._since_plots_s < PLOT_PERIOD_S:
            return
        with self._server.atomic():
            self._draw(sample)
        self._drawn = drawn

    def close(self) -> None:
        """Serve no more."""
        with _quiet():
            self._server.stop()

    # ---- what a page of its own kind says ----------------------------------------------------------------------------

    def _pass_time(self, elapsed_s: float) -> None:
        self.player.advance(elapsed_s)

    @abstractmethod
    def _curves_now(self) -> tuple[Curves, ...]:
        """What is plotted."""

    @abstractmethod
    def _status_at(self, sample: int) -> str:
        """In a line of Markdown, how it stands at a sample."""

    @abstractmethod
    def _legend(self) -> str:
        """The colours that all plots share, in HTML."""

    @abstractmethod
    def _draw_scene(self, sample: int) -> None:
        """Whatever is drawn beside the plots."""

    @abstractmethod
    def _add_own_controls(self) -> None:
        """Controls of what is drawn beside the plots."""

    def _welcome(self, _client: viser.ClientHandle) -> None:
        self.watched = True

    # ---- drawing ---------------------------------------------------------------------------------------------------

    def _draw(self, sample: int) -> None:
        self._draw_scene(sample)
        self._play.label = "Pause" if self.player.playing else "Play"
        now_s = min(max(self.player.time_s, self._time.min), self._time.max)
        self._time.value = now_s  # type: ignore[misc]  # mypy does not see its setter
        self._status.content = self._status_at(sample)
        if self._share is not None and not self.player.playing:
            self._share.content = f"`design view --log {self._timeline.source} --at {self.player.time_s:.3f}`"
        if self._since_plots_s >= PLOT_PERIOD_S or not self.player.playing:
            self._since_plots_s = 0.0
            for plot, curves in zip(self._plots, self._curves, strict=True):
                plot.data = curves.until(sample)

    def _show_grown(self, shown: Timeline) -> None:
        """Go on with a longer run of the same kind."""
        self._timeline = shown
        self.player.follow(shown.begin_s, shown.end_s)
        self._time.min, self._time.max = shown.begin_s, max(shown.end_s, shown.begin_s + 1e-3)
        before, self._curves = self._curves, self._curves_now()
        if [list(curves.labels) for curves in before] != [list(curves.labels) for curves in self._curves]:
            self._plot_anew()
        for plot, curves in zip(self._plots, self._curves, strict=True):
            plot.scales = self._scales(curves)
        histogram = step_histogram(shown.step_us)
        if histogram is not None and self._histogram is not None:
            self._histogram.data = (histogram.edge, histogram.count)
            self._histogram.title = histogram.title

    def _plot_anew(self) -> None:
        """Plots in place of those there are, which have other lines."""
        for plot in (*self._plots, *([] if self._histogram is None else [self._histogram])):
            plot.remove()
        self._plots = [self._add_plot(curves) for curves in self._curves]
        self._histogram = self._add_histogram()

    # ---- controls and plots ----------------------------------------------------------------------------------------

    def _add_controls(self) -> None:
        gui, shown = self._server.gui, self._timeline
        self._status = gui.add_markdown("")
        self._play = gui.add_button("Pause")
        self._play.on_click(lambda _: self._actions.put(self.player.toggle))
        end_s = max(shown.end_s, shown.begin_s + 1e-3)
        step = (end_s - shown.begin_s) / _TIME_STEPS
        self._time = gui.add_slider("time (s)", shown.begin_s, end_s, step, shown.begin_s)

        @self._time.on_update
        def _(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
            if event.client is not None:  # moved by hand, not by the clock
                self._actions.put(lambda: self._scrub(event.target.value))

        if not self._is_live:
            speed = gui.add_dropdown(
                "speed", [f"{speed:g}" for speed in SPEEDS], initial_value=f"{self.player.speed:g}"
            )
            speed.on_update(lambda _: self._actions.put(lambda: setattr(self.player, "speed", float(speed.value))))
        self._add_own_controls()
        self._share: viser.GuiMarkdownHandle | None = None
        if shown.source:
            with gui.add_folder("share", expand_by_default=False):
                gui.add_markdown("Whoever has the file opens this moment with (pause to update):")
                self._share = gui.add_markdown(f"`design view --log {shown.source}`")
        gui.add_html(self._legend())

    def _scrub(self, time_s: float) -> None:
        self.player.playing = False
        self.player.seek(time_s)

    def _scales(self, curves: Curves) -> dict[str, uplot.Scale]:
        begin_s, end_s = self._timeline.begin_s, max(self._timeline.end_s, self._timeline.begin_s + 1e-3)
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
            curves.until(int(curves.rows[-1])),
            (uplot.Series(label="t"), *lines),
            title=curves.title,
            scales=self._scales(curves),
            legend=uplot.Legend(show=False),
            height=_PLOT_HEIGHT,
            padding=_PADDING,
            axes=_AXES,
        )

    def _add_histogram(self) -> viser.GuiUplotHandle | None:
        histogram = step_histogram(self._timeline.step_us)
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


def _quiet() -> contextlib.redirect_stdout[io.StringIO]:
    """Keeps what the viewer says of its server from standard output."""
    return contextlib.redirect_stdout(io.StringIO())
