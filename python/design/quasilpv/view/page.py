"""The page of a robot: plots, and the robot in a scene that can be turned; of a run that is over, or as it happens."""

from __future__ import annotations

import viser

from quasilpv.figures.style import JOINT_COLOURS
from quasilpv.view.curves import Curves, curves_of
from quasilpv.view.live import LiveMotion
from quasilpv.view.playback import Instant, Playback
from quasilpv.view.plot_page import HOST, PLOT_PERIOD_S, PlotPage
from quasilpv.view.robot_scene import RobotScene

__all__ = ["HOST", "Page"]


class Page(PlotPage):
    """A page, served from creation to `close`; `step` is to be called some thirty times a second.

    Args:
        playback: what is shown; of a live run, what there is of it so far.
        port: on the loopback interface.
        live: where the rest of a live run comes from; None for a run that is over.

    Raises:
        InputError: the port is taken.

    Attributes:
        scene: what is drawn.
    """

    def __init__(self, playback: Playback, port: int, live: LiveMotion | None = None) -> None:
        """Serve."""
        super().__init__(playback, port, live=live is not None)
        self._playback, self._live = playback, live
        self.scene = RobotScene(self._server, playback)
        self.show_first()

    def _welcome(self, client: viser.ClientHandle) -> None:
        super()._welcome(client)
        self.scene.fit(client.camera)

    def _pass_time(self, elapsed_s: float) -> None:
        if self._live is None:
            super()._pass_time(elapsed_s)
            return
        motion = self._live.poll()
        if motion is None or motion is self._playback.motion or self._since_plots_s < PLOT_PERIOD_S:
            return
        self._playback = self._playback.with_motion(motion)
        self.scene.show_paths(self._playback)
        self._show_grown(self._playback)

    def _curves_now(self) -> tuple[Curves, ...]:
        return curves_of(self._playback)

    def _draw_scene(self, sample: int) -> None:
        self.scene.show(self._instant(sample))

    def _status_at(self, sample: int) -> str:
        return _status(self._instant(sample), self.scene.exaggeration)

    def _instant(self, sample: int) -> Instant:
        return self._playback.at(float(self._playback.motion.time_s[sample]))

    def _add_own_controls(self) -> None:
        gui = self._server.gui
        with gui.add_folder("show", expand_by_default=False):
            shadow = gui.add_checkbox("robot on its reference", self.scene.show_shadow)
            magnified = gui.add_checkbox("tool path, error magnified", True)
            skeleton = gui.add_checkbox("robot as bars", not self._playback.meshes)

        def show(_: object) -> None:
            self.scene.set_visible(shadow=shadow.value, magnified=magnified.value, skeleton=skeleton.value)

        shadow.on_update(show)
        magnified.on_update(show)
        skeleton.on_update(show)

    def _legend(self) -> str:
        """The colours of the joints, which all plots share; premises have the same in their order."""
        joints = self._playback.motion.angle_rad.shape[1]
        names = (f'<span style="color:{JOINT_COLOURS[k]}">&#9632; joint {k + 1}</span>' for k in range(joints))
        return f'<div style="font-size:0.8em; padding:0 1em">{" &nbsp; ".join(names)} &nbsp; over time in s</div>'


def _status(instant: Instant, exaggeration: float) -> str:
    error_um = 1e6 * float((instant.error_m**2).sum()) ** 0.5
    healthy = "healthy" if instant.flags == 0 else f"flags {instant.flags:#b}"
    return (
        f"**{instant.time_s:.3f} s** · controller **{instant.state}**, {healthy} · tool error **{error_um:.1f} µm**"
        f" (orange path: × {exaggeration:g})"
    )
