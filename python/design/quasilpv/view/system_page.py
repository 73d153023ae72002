"""The page of a general system: its signals, V and step times as curves, its phase portraits beside them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt
import viser
from PIL import Image

from quasilpv.arrays import FloatArray
from quasilpv.documents.system_artifact import Signal, SystemArtifactDocument
from quasilpv.experiments.system_logged import logged_system_run
from quasilpv.experiments.system_run import SystemExperiment, SystemRun, scenario_of
from quasilpv.figures.phase import SHORTEST_S, PhasePortrait
from quasilpv.figures.style import BLACK, BLUE, GREEN, REFERENCE_COLOUR, VERMILION
from quasilpv.telemetry import RunLog
from quasilpv.telemetry.codes import STATES, SYSTEM_FLAGS, word
from quasilpv.telemetry.message_types import Records
from quasilpv.telemetry.system_recording import TELEMETRY, system_columns_of
from quasilpv.view.curves import MAX_POINTS, Curves
from quasilpv.view.live import Live
from quasilpv.view.playback import SPEEDS
from quasilpv.view.plot_page import PLOT_PERIOD_S, PlotPage

NEAR = 3.0
"""A limit is plotted if a signal comes within so many times its own largest magnitude."""
DOTS_PER_INCH = 160
ASPECT = 1.2
"""Of the space beside the plots, until a browser says what it has."""


@dataclass(frozen=True, eq=False)
class SystemTimeline:
    """A run of a general system over time.

    Attributes:
        title: of the run.
        run: its samples.
        state: (N,) of the controller, index into `codes.STATES`.
        step_us: (N,) time of the control step; 0 where none was measured.
        source: name of the log, as others may have it.
    """

    title: str
    run: SystemRun
    state: npt.NDArray[np.int64]
    step_us: FloatArray
    source: str = ""

    @classmethod
    def of_log(cls, log: RunLog, source: str) -> Self:
        """A logged run. InputError: the log lacks telemetry or the truth."""
        run = logged_system_run(log)
        telemetry = log["telemetry"].samples
        known = np.isin(telemetry["seq"], log["truth"].samples["seq"])
        return cls(
            f"{run.artifact.name}, {log.header.mode}",
            run,
            telemetry["state"][known].astype(np.int64),
            1e-3 * telemetry["step_ns"][known],
            source,
        )

    @classmethod
    def of_telemetry(cls, records: Records, artifact: SystemArtifactDocument) -> Self:
        """What telemetry alone tells, samples in order: the measured states are the truth.

        A state that was not measured is where it was last.
        """
        columns = system_columns_of(TELEMETRY, records, artifact)
        known = np.isfinite(columns["measured"])
        last = np.maximum.accumulate(np.where(known, np.arange(len(known))[:, None], 0), axis=0)
        measured = np.nan_to_num(np.take_along_axis(columns["measured"], last, axis=0))
        run = SystemRun(
            artifact=artifact,
            scenario=scenario_of(artifact, SystemExperiment({}, {}), artifact.name),
            time_s=records["seq"] * artifact.sample_period_s,
            state=measured,
            measured=measured,
            input=columns["input"],
            commanded=columns["commanded"],
            premise=columns["premise"],
            level=np.nan_to_num(np.array(records["level"])),
            measured_level=np.array(records["level"]),
            sample_flags=records["flags"].astype(np.int64),
            exit=None,
        )
        return cls(f"live: {artifact.name}", run, records["state"].astype(np.int64), 1e-3 * records["step_ns"])

    @property
    def begin_s(self) -> float:
        """Time of the first sample."""
        return float(self.run.time_s[0])

    @property
    def end_s(self) -> float:
        """Time of the last sample."""
        return float(self.run.time_s[-1])

    def sample_at(self, time_s: float) -> int:
        """Index of the last sample that is not later than a time; 0 before the first."""
        return max(int(np.searchsorted(self.run.time_s, time_s + 1e-9, side="right")) - 1, 0)

    @cached_property
    def rows(self) -> npt.NDArray[np.int64]:
        """The samples that are plotted."""
        return np.unique(np.linspace(0, len(self.run.time_s) - 1, MAX_POINTS).astype(np.int64))


def system_curves(timeline: SystemTimeline) -> tuple[Curves, ...]:
    """Every state with what was measured of it, every input, limits dashed where they are near, and log10 V."""
    run, rows = timeline.run, timeline.rows
    plots = [
        _signal_curves(timeline, k, signal) for k, signal in enumerate((*run.artifact.states, *run.artifact.inputs))
    ]
    level = np.log10(np.maximum(run.level[rows], 1e-12))
    one = np.zeros_like(level)
    plots.append(
        Curves(
            "log10 V: the region is below 0",
            ["V", "1"],
            [GREEN, BLACK],
            rows,
            run.time_s[rows],
            np.column_stack([level, one]),
            [False, True],
        )
    )
    return tuple(plots)


def _signal_curves(timeline: SystemTimeline, place: int, signal: Signal) -> Curves:
    run, rows = timeline.run, timeline.rows
    n = len(run.artifact.states)
    values = (run.state[:, place] if place < n else run.input[:, place - n])[rows]
    lines = {signal.name: (values, BLUE if place < n else VERMILION, False)}
    if place < n and np.any(run.measured[:, place] != run.state[:, place]):
        lines = {"measured": (run.measured[rows, place], REFERENCE_COLOUR, False), **lines}
    reach = NEAR * float(np.abs(values - signal.trim).max())
    for name, bound in (("lower limit", signal.low), ("upper limit", signal.high)):
        if bound is not None and abs(bound) < reach:
            lines[name] = (np.full(len(rows), bound + signal.trim), BLACK, True)
    unit = "" if signal.unit in ("", "1") else f" ({signal.unit})"
    return Curves(
        f"{signal.name}{unit}",
        list(lines),
        [colour for _, colour, _ in lines.values()],
        rows,
        run.time_s[rows],
        np.nan_to_num(np.column_stack([line for line, _, _ in lines.values()])),
        [dashed for _, _, dashed in lines.values()],
    )


class LiveTimeline(Live[SystemTimeline]):
    """The last seconds of a general system as it runs. Errors: `quasilpv.view.live.Live`."""

    def __init__(self, url: str, artifact: SystemArtifactDocument) -> None:
        """Listen."""
        self._artifact = artifact
        super().__init__(url, TELEMETRY, artifact.hash, artifact.sample_period_s)

    def _made(self, records: Records) -> SystemTimeline:
        return SystemTimeline.of_telemetry(records, self._artifact)


class SystemPage(PlotPage):
    """A page, served from creation to `close`; `step` is to be called some thirty times a second.

    Args:
        timeline: what is shown; of a live run, what there is of it so far.
        port: on the loopback interface.
        live: where the rest of a live run comes from; None for a run that is over.

    Raises:
        InputError: the port is taken.
    """

    def __init__(self, timeline: SystemTimeline, port: int, live: LiveTimeline | None = None) -> None:
        """Serve."""
        super().__init__(timeline, port, live=live is not None)
        self._shown_run, self._live = timeline, live
        self._portrait = PhasePortrait(timeline.run, DOTS_PER_INCH)
        self._client: viser.ClientHandle | None = None
        self._pictured: tuple[int, float] | None = None
        duration = timeline.end_s - timeline.begin_s
        if live is None:
            self.player.speed = max((speed for speed in SPEEDS if duration >= speed * SHORTEST_S), default=SPEEDS[0])
        self.show_first()

    def _pass_time(self, elapsed_s: float) -> None:
        if self._live is None:
            super()._pass_time(elapsed_s)
            return
        timeline = self._live.poll()
        if timeline is None or timeline is self._shown_run or self._since_plots_s < PLOT_PERIOD_S:
            return
        self._shown_run, self._pictured = timeline, None
        self._portrait.follow(timeline.run)
        self._show_grown(timeline)

    def _welcome(self, client: viser.ClientHandle) -> None:
        super()._welcome(client)
        self._client = client

    def _curves_now(self) -> tuple[Curves, ...]:
        return system_curves(self._shown_run)

    def _draw_scene(self, sample: int) -> None:
        aspect = ASPECT if self._client is None else float(self._client.camera.aspect)
        if self._pictured == (sample, aspect):
            return
        self._pictured = (sample, aspect)
        picture = on_white(self._portrait.frame(sample), aspect)
        self._server.scene.set_background_image(np.asarray(picture), format="png")

    def _add_own_controls(self) -> None:
        """There is nothing to choose."""

    def _status_at(self, sample: int) -> str:
        run = self._shown_run.run
        flags = [text for bit, text in SYSTEM_FLAGS.items() if int(run.sample_flags[sample]) & bit]
        state = word(STATES, int(self._shown_run.state[sample]))
        return (
            f"**{run.time_s[sample]:.4g} s** · controller **{state}**, {', '.join(flags) or 'healthy'}"
            f" · V **{run.level[sample]:.3g}**"
        )

    def _legend(self) -> str:
        names = ((BLUE, "states"), (REFERENCE_COLOUR, "measured"), (VERMILION, "inputs"), (BLACK, "limits"))
        shown = " &nbsp; ".join(f'<span style="color:{colour}">&#9632; {name}</span>' for colour, name in names)
        return f'<div style="font-size:0.8em; padding:0 1em">{shown} &nbsp; over time in s</div>'


def on_white(picture: Image.Image, aspect: float) -> Image.Image:
    """A picture in the middle of a white one of this width by height: a browser stretches it to what it has."""
    width, height = picture.size
    size = (max(width, round(height * aspect)), max(height, round(width / aspect)))
    framed = Image.new("RGB", size, "white")
    framed.paste(picture, ((size[0] - width) // 2, (size[1] - height) // 2))
    return framed
