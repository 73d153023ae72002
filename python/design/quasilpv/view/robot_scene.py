"""The robot in three dimensions: links as bars, joints as pins, its reference as a shadow, both paths of the tool.

A planar mechanism moves in the vertical plane y = 0 of the scene: X to the right, Y of the mechanism up. A robot in
space stands in it as it stands in its base's frame.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import viser
from viser.transforms import SO3

from quasilpv.arrays import FloatArray
from quasilpv.descriptions.meshes import BodyMesh
from quasilpv.figures.space import Viewpoint
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
BODY_COLOUR = (176, 190, 204)
PATH_POINTS = 400
BEFORE_THE_PLANE = np.array([0.3, -1.2, 0.25])
"""Where the camera starts, from the middle of a planar robot, in parts of its extent."""
DISTANCE = 1.35
"""The same of a robot in space, from where `Viewpoint` looks."""
BELOW = 0.42
"""How far below the robot's middle a camera looks that sees it above the controls, in parts of what it sees."""
_EAST = np.array([1.0, 0.0, 0.0])


class RobotScene:
    """The scene of a playback.

    Args:
        server: of the page.
        playback: of the run.

    Attributes:
        robot: its links and joints.
        bodies: joint and mesh of every body that has one.
        exaggeration: by which the error is magnified.
        show_shadow: whether the robot on its reference can be told from the robot.
    """

    def __init__(self, server: viser.ViserServer, playback: Playback) -> None:
        """Draw what does not move, and make what does."""
        scene = server.scene
        scene.set_up_direction("+z")
        links = playback.at(playback.begin_s).links_m
        lengths = np.linalg.norm(np.diff(links, axis=0), axis=1)
        # A link that only ties things together, as the spring of the disc, may have no length at some time.
        width = 0.075 * float(np.max(lengths))
        self.robot = _Bars(scene, "robot", links.shape, width, (LINK_COLOUR, None))
        self.bodies = [_add_body(scene, mesh) for mesh in playback.meshes]
        self._shadow = _Bars(scene, "reference robot", links.shape, 0.6 * width, (SHADOW_COLOUR, 0.35))
        self._scene = scene
        self._line_width = 0.12 * width
        self._shows_magnified = True
        self._place_camera(server, playback)
        self.show_paths(playback)
        self.show_shadow = self.exaggeration == 1.0
        self.set_visible(shadow=self.show_shadow, magnified=True, skeleton=not self.bodies)

    def _place_camera(self, server: viser.ViserServer, playback: Playback) -> None:
        count = playback.motion.samples
        angles = playback.motion.angle_rad[:: max(count // 50, 1)]
        points = np.concatenate([in_space(playback.mechanism.skeleton(angle)) for angle in angles])
        low, high = points.min(axis=0), points.max(axis=0)
        centre, extent = (low + high) / 2.0, float(max(high - low))
        reference = playback.reference_tool_m
        stands = reference.shape[1] > 2
        self._towards = DISTANCE * Viewpoint.of_path(reference).direction if stands else BEFORE_THE_PLANE
        # The controls cover the right quarter of the page.
        right = np.cross([0.0, 0.0, 1.0], self._towards)
        look_at = centre + 0.22 * extent * right / np.linalg.norm(right)
        self._centre, self._extent = centre, extent
        server.initial_camera.look_at = _triple(look_at)
        server.initial_camera.position = _triple(look_at + extent * self._towards)
        self._scene.add_grid(
            "floor",
            width=4.0 * extent,
            height=4.0 * extent,
            cell_size=0.1 * extent,
            section_size=0.5 * extent,
            position=(centre[0], centre[1], min(low[2], 0.0) if stands else low[2] - 0.15 * extent),
        )

    def fit(self, camera: viser.CameraHandle) -> None:
        """On a screen that is higher than wide the controls cover the lower part: look at the robot above them."""
        if camera.aspect < 1.0:
            look_at = self._centre - np.array([0.0, 0.0, BELOW * self._extent / camera.aspect])
            camera.position = look_at + 1.15 * self._extent / camera.aspect * self._towards
            camera.look_at = look_at

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
        place = _triple(-behind * self._line_width * self._towards / np.linalg.norm(self._towards))
        width = widths * self._line_width
        return self._scene.add_line_segments(
            f"/paths/{name}", _segments(points), colour, thickness=width, position=place
        )

    def show(self, instant: Instant) -> None:
        """Move everything to an instant."""
        self.robot.move(instant.links_m)
        self._shadow.move(instant.reference_links_m)
        for joint, body in self.bodies:
            rotation, origin = instant.frames[joint + 1]
            body.wxyz, body.position = SO3.from_matrix(rotation).wxyz, _triple(origin)
        drawn = int(np.searchsorted(self._rows, instant.sample, side="right"))
        for handle, segments in self._segments:
            handle.points = segments[: max(drawn - 1, 1)].astype(np.float32)

    def set_visible(self, *, shadow: bool, magnified: bool, skeleton: bool = True) -> None:
        """Show or hide the robot on its reference, the magnified error, and the robot as bars."""
        self.robot.root.visible = skeleton
        self._shadow.root.visible = shadow
        self._shows_magnified = self._magnified.visible = magnified


def _add_body(scene: viser.SceneApi, mesh: BodyMesh) -> tuple[int, viser.MeshHandle]:
    """The joint that a body moves with, and its mesh in the scene."""
    name, vertices, faces = f"/bodies/{mesh.link}", mesh.vertices_m.astype(np.float32), mesh.faces.astype(np.uint32)
    return mesh.joint, scene.add_mesh_simple(name, vertices, faces, color=BODY_COLOUR)


class _Bars:
    """Links and joints of one robot, below one frame of the scene: pins in a plane, balls in space."""

    def __init__(
        self, scene: viser.SceneApi, name: str, shape: tuple[int, ...], width: float, look: tuple[Colour, float | None]
    ) -> None:
        points, dimensions = shape
        self.root = scene.add_frame(f"/{name}", show_axes=False)
        colour, clear = look
        # Bars have unit length and are stretched, because a spring changes its own.
        self.links = [
            scene.add_box(f"/{name}/link {k + 1}", colour, (1.0, 0.6 * width, width), opacity=clear)
            for k in range(points - 1)
        ]
        along_y = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
        self.joints: list[viser.CylinderHandle | viser.IcosphereHandle] = []
        for k in range(points):
            own, tint, radius = f"/{name}/joint {k + 1}", BASE_COLOUR if k == 0 else PIN_COLOUR, 0.62 * width
            if dimensions == 2:
                self.joints.append(scene.add_cylinder(own, radius, width, color=tint, opacity=clear, wxyz=along_y))
            else:
                self.joints.append(scene.add_icosphere(own, radius, color=tint, opacity=clear))

    def move(self, links: FloatArray) -> None:
        """Put every link between its ends."""
        points = in_space(links)
        for bar, start, end in zip(self.links, points[:-1], points[1:], strict=True):
            along = end - start
            length = float(np.linalg.norm(along))
            bar.position = _triple((start + end) / 2.0)
            bar.wxyz = turned_from_x(along / length if length > 0.0 else _EAST)
            bar.scale = (max(length, 1e-6), 1.0, 1.0)
        for joint, point in zip(self.joints, points, strict=True):
            joint.position = _triple(point)


def turned_from_x(direction: FloatArray) -> tuple[float, float, float, float]:
    """Quaternion (w, x, y, z) of the least turn from the x axis to a unit vector; backwards about -y."""
    w = 1.0 + float(direction[0])
    if w < 1e-12:
        return 0.0, 0.0, -1.0, 0.0
    x, y, z = np.cross(_EAST, direction) / np.sqrt(2.0 * w)
    return float(np.sqrt(0.5 * w)), float(x), float(y), float(z)


def in_space(points: FloatArray) -> FloatArray:
    """Points of the vertical plane, (N, 2), in the scene; those in space, (N, 3), are there already."""
    if points.shape[1] > 2:
        return points
    return np.column_stack([points[:, 0], np.zeros(len(points)), points[:, 1]])


def _triple(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _segments(points: FloatArray) -> FloatArray:
    """A line through points as segments in space, (points - 1, 2, 3)."""
    space = in_space(points)
    return np.stack([space[:-1], space[1:]], axis=1) if len(points) > 1 else np.repeat(space[None], 2, axis=1)
