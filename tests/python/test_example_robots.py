"""Arms of the examples stand as the documents of their makers say; docs/gallery.md designs for them and runs them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from quasilpv.descriptions.robot_file import read_robot_file

Flange = Callable[[np.ndarray], np.ndarray]
ROBOTS = Path(__file__).parents[2] / "examples" / "robots"

# Modified Denavit-Hartenberg parameters a, d, alpha of Franka's documentation (control parameters, Panda), flange last;
# the iiwa by the distances of its axes in KUKA's data sheet: 360, 420, 400 and 126 mm from shoulder to flange.
PANDA_A_M = (0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088, 0.0)
PANDA_D_M = (0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0, 0.107)
PANDA_ALPHA_RAD = np.pi / 2.0 * np.array([0.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0, 0.0])
IIWA_LENGTHS_M = (0.36, 0.42, 0.4, 0.126)


def turned(axis: int, angle: float) -> np.ndarray:
    """A homogeneous rotation about x (0) or z (2)."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(4)
    i, k = (1, 2) if axis == 0 else (0, 1)
    matrix[i, i], matrix[i, k], matrix[k, i], matrix[k, k] = c, -s, s, c
    return matrix


def moved(x: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[0, 3], matrix[2, 3] = x, z
    return matrix


def panda_flange(angles: np.ndarray) -> np.ndarray:
    """Craig's convention: Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d)."""
    place = np.eye(4)
    for a, d, alpha, angle in zip(PANDA_A_M, PANDA_D_M, PANDA_ALPHA_RAD, [*angles, 0.0], strict=True):
        place = place @ turned(0, alpha) @ moved(a, 0.0) @ turned(2, angle) @ moved(0.0, d)
    return place[:3, 3]


def iiwa_flange(angles: np.ndarray) -> np.ndarray:
    """Z, Y, Z, -Y, Z, Y, Z, one above the other."""
    place, signs = np.eye(4), (1.0, -1.0, 1.0)
    for k, length in enumerate(IIWA_LENGTHS_M):
        place = place @ turned(2, angles[2 * k]) @ moved(0.0, length)
        if k < 3:
            y = turned(2, np.pi / 2.0) @ turned(0, signs[k] * angles[2 * k + 1]) @ turned(2, -np.pi / 2.0)
            place = place @ y
    return place[:3, 3]


@pytest.mark.parametrize(("name", "flange"), [("panda", panda_flange), ("iiwa", iiwa_flange)])
def test_the_flange_is_where_the_makers_parameters_put_it(
    name: str, flange: Callable[[np.ndarray], np.ndarray]
) -> None:
    robot = read_robot_file(ROBOTS / f"{name}.toml").robot()
    for angles in np.random.default_rng(5).uniform(-2.0, 2.0, (4, 7)):
        assert_allclose(robot.model.forward_kinematics(angles), flange(angles), atol=1e-9)
