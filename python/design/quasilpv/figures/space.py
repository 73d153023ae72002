"""Plots in three dimensions: the skeleton of a robot, the path of its tool, and from where one looks at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D

from quasilpv.arrays import FloatArray

LINK_COLOUR = "#4d5a66"
FLOOR_COLOUR = "#d9d9d9"
BESIDE_DEG = 35.0
"""By which one looks past the normal of a path: head-on the robot behind it would have no depth."""


@dataclass(frozen=True)
class Viewpoint:
    """A direction to look from, degrees."""

    elevation_deg: float
    azimuth_deg: float

    @property
    def direction(self) -> FloatArray:
        """(3,), the unit vector from what is looked at."""
        elevation, azimuth = np.radians([self.elevation_deg, self.azimuth_deg])
        flat = np.cos(elevation)
        return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])

    @classmethod
    def of_path(cls, path: FloatArray) -> Viewpoint:
        """From the side of the path that is away from the base, a little beside its normal; from above if it lies flat.

        Args:
            path: (N, 3), m, in the frame of the base.
        """
        centre = path.mean(axis=0)
        normal = np.linalg.svd(path - centre, full_matrices=False)[2][-1]
        if abs(normal[2]) > np.hypot(normal[0], normal[1]):
            normal = centre * np.array([1.0, 1.0, 0.0]) + np.array([1e-9, 0.0, 0.0])
            elevation = 40.0
        else:
            normal, elevation = normal * (1.0 if normal @ centre >= 0.0 else -1.0), 18.0
        return cls(elevation, float(np.degrees(np.arctan2(normal[1], normal[0]))) - BESIDE_DEG)


def space_axes(figure: Figure, place: SubplotSpec, points: FloatArray, viewpoint: Viewpoint, zoom: float) -> Axes3D:
    """Axes with equal scales and room for all points, (N, 3), and for the floor below the base."""
    axes: Axes3D = figure.add_subplot(place, projection="3d", computed_zorder=False)
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = min(low[2], 0.0)
    room = 0.04 * float((high - low).max())
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room, high[1] + room)
    axes.set_zlim(low[2], high[2] + room)
    extent = high - low + room * np.array([2.0, 2.0, 1.0])
    axes.set_box_aspect((extent[0], extent[1], extent[2]), zoom=zoom)
    axes.view_init(elev=viewpoint.elevation_deg, azim=viewpoint.azimuth_deg)
    for name, axis in (("X (m)", axes.xaxis), ("Y (m)", axes.yaxis), ("Z (m)", axes.zaxis)):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_label_text(name)
        axis.set_rotate_label(False)
        axis.labelpad = 8.0 if axis is axes.zaxis else 3.0
        axis.set_tick_params(pad=-1.0)
        axis.set_major_locator(MaxNLocator(4))
    return axes


def draw_skeleton(axes: Axes, points: FloatArray, colour: str = LINK_COLOUR, alpha: float = 1.0) -> Any:
    """The links as one thick line with a dot at every joint; the line, whose data can be moved."""
    (links,) = axes.plot(
        *points.T, color=colour, alpha=alpha, linewidth=4.0, marker="o", markersize=5.0, markerfacecolor="white"
    )
    return links


def draw_shadow(axes: Axes, points: FloatArray) -> Any:
    """The same seen from above, on the floor, which tells how far things are."""
    (shadow,) = axes.plot(*on_floor(points).T, color=FLOOR_COLOUR, linewidth=2.4, solid_capstyle="round")
    return shadow


def on_floor(points: FloatArray) -> FloatArray:
    """Points (N, 3) straight below, in the plane of the base or below the lowest of them."""
    flat = points.copy()
    flat[:, 2] = 0.0
    return flat
