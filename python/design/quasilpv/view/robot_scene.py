"""The robot in three dimensions: links as bars, joints as pins, its reference as a shadow, both paths of the tool.

The mechanism moves in the vertical plane y = 0 of the scene: X to the right, Y of the mechanism up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import viser

from quasilpv.arrays import FloatArray
from quasilpv.figures.tracking import exaggeration
from quasilpv.view.playback import Instant, Playback

Colour: TypeAlias = tuple[int, int, int]

LINK_COLOUR, PIN_COLOUR, BASE_COLOUR = (0, 114, 178), (64, 70, 80), (90, 96, 104)
SHADOW_COLOUR, REFERENCE_COLOUR, TOOL_COLOUR, ERROR_COLOUR = (
    (140, 140, 140),
    (150, 150, 150),
    (0, 114, 178),
    (213, 94, 0),
)
PATH_POINTS = 400
_EAST = np.array([1.0, 0.0])


class RobotScene:
    """The scene of a playback.

    Args:
        server: of the page.
        playback: of the run.

    Attributes:
        exaggeration: by which the error is magnified.
        show_shadow: whether the robot on its reference can be told from the robot.
    """

    def __init__(self, server: viser.ViserServer, playback: Playback) -> None:
        """Draw what does not move, and make what does."""
        scene = server.scene
        scene.set_up_direction("+z")
        links = playback.at(playback.begin_s).links_m
        lengths = np.hypot(*np.diff(links, axis=0).T)
        # A link that only ties things together, as the spring of the disc, may have no length at some time.
        width = 0.075 * float(np.max(lengths))
        self._bars = _Bars(scene, "robot", links.shape[0], width, (LINK_COLOUR, None))
        self._shadow = _Bars(scene, "reference robot", links.shape[0], 0.6 * width, (SHADOW_COLOUR, 0.35))
        self._scene = scene
        self._line_width = 0.12 * width
        self._shows_magnified = True
        self._place_camera(server, playback)
        self.show_paths(playback)
        self.show_shadow = self.exaggeration == 1.0
        self.set_visible(shadow=self.show_shadow, magnified=True)

    def _place_camera(self, server: viser.ViserServer, playback: Playback) -> None:
        count = playback.motion.samples
        angles = playback.motion.angle_rad[:: max(count // 50, 1)]
        points = np.concatenate([playback.mechanism.skeleton(angle) for angle in angles])
        low, high = points.min(axis=0), points.max(axis=0)
        centre, extent = (low + high) / 2.0, float(max(high - low))
        # The controls cover the right quarter of the page.
        x, z = centre + extent * np.array([0.22, 0.0])
        server.initial_camera.look_at = (x, 0.0, z)
        server.initial_camera.position = (x + 0.3 * extent, -1.2 * extent, z + 0.25 * extent)
        self._scene.add_grid(
            "floor",
            width=4.0 * extent,
            height=4.0 * extent,
            cell_size=0.1 * extent,
            section_size=0.5 * extent,
            position=(centre[0], 0.0, low[1] - 0.15 * extent),
        )

    def show_paths(self, playback: Playback) -> None:
        """Draw the reference of the whole motion, the way of the tool, and that way with its error exaggerated."""
        rows = np.unique(np.linspace(0, playback.motion.samples - 1, PATH_POINTS).astype(int))
        self._rows = rows
        reference, tool = playback.reference_tool_m[rows], playback.tool_m[rows]
        self.exaggeration = exaggeration(tool - reference, reference)
        # One behind the other, seen from where the camera starts: none covers the next.
        self._path("reference path", reference, REFERENCE_COLOUR, 2.0, behind=2.0)
        self._tool = self._path("tool path", tool, TOOL_COLOUR, 1.0, behind=0.0)
        magnified = reference + self.exaggeration * (tool - reference)
        self._magnified = self._path("tool path, error magnified", magnified, ERROR_COLOUR, 1.0, behind=-1.0)
        self._magnified.visible = self._shows_magnified
        self._segments = [(self._tool, _segments(tool)), (self._magnified, _segments(magnified))]

    def _path(
        self, name: str, points: FloatArray, colour: Colour, widths: float, *, behind: float
    ) -> viser.LineSegmentsHandle:
        place = (0.0, behind * self._line_width, 0.0)
        width = widths * self._line_width
        return self._scene.add_line_segments(
            f"/paths/{name}", _segments(points), colour, thickness=width, position=place
        )

    def show(self, instant: Instant) -> None:
        """Move everything to an instant."""
        self._bars.move(instant.links_m)
        self._shadow.move(instant.reference_links_m)
        drawn = int(np.searchsorted(self._rows, instant.sample, side="right"))
        for handle, segments in self._segments:
            handle.points = segments[: max(drawn - 1, 1)].astype(np.float32)

    def set_visible(self, *, shadow: bool, magnified: bool) -> None:
        """Show or hide the robot on its reference, and the magnified error."""
        self._shadow.root.visible = shadow
        self._shows_magnified = self._magnified.visible = magnified


@dataclass
class _Placement:
    position: tuple[float, float, float]
    wxyz: tuple[float, float, float, float]


class _Bars:
    """Links and pins of one robot, below one frame of the scene."""

    def __init__(
        self, scene: viser.SceneApi, name: str, points: int, width: float, look: tuple[Colour, float | None]
    ) -> None:
        self.root = scene.add_frame(f"/{name}", show_axes=False)
        colour, clear = look
        # Bars have unit length and are stretched, because a spring changes its own.
        self._bars = [
            scene.add_box(f"/{name}/link {k + 1}", colour, (1.0, 0.6 * width, width), opacity=clear)
            for k in range(points - 1)
        ]
        self._pins = [
            scene.add_cylinder(
                f"/{name}/pin {k + 1}",
                radius=0.62 * width,
                height=width,
                color=BASE_COLOUR if k == 0 else PIN_COLOUR,
                opacity=clear,
                wxyz=(np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0),
            )
            for k in range(points)
        ]

    def move(self, points: FloatArray) -> None:
        """Put every link between its ends."""
        for bar, start, end in zip(self._bars, points[:-1], points[1:], strict=True):
            along = end - start
            length = float(np.hypot(*along))
            placed = _placement((start + end) / 2.0, along if length > 0.0 else _EAST)
            bar.position, bar.wxyz = placed.position, placed.wxyz
            bar.scale = (max(length, 1e-6), 1.0, 1.0)
        for pin, point in zip(self._pins, points, strict=True):
            pin.position = _in_space(point)


def _placement(point: FloatArray, along: FloatArray) -> _Placement:
    """Where a bar along x goes that points along a direction of the plane: a turn about -y by its angle."""
    half = 0.5 * float(np.arctan2(along[1], along[0]))
    return _Placement(_in_space(point), (float(np.cos(half)), 0.0, -float(np.sin(half)), 0.0))


def _in_space(point: FloatArray) -> tuple[float, float, float]:
    return float(point[0]), 0.0, float(point[1])


def _segments(points: FloatArray) -> FloatArray:
    """A line through points of the plane as segments in space, (points - 1, 2, 3)."""
    space = np.column_stack([points[:, 0], np.zeros(len(points)), points[:, 1]])
    return np.stack([space[:-1], space[1:]], axis=1) if len(points) > 1 else np.repeat(space[None], 2, axis=1)
