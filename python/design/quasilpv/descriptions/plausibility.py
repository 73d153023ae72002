"""Whether the numbers of a description can belong to a robot: refused where they cannot, doubted where they hardly can.

Looked at are the bodies that move, after everything fixed to them was merged into them: a link without inertia of its
own is common, and harmless once it is part of another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quasilpv.errors import InputError
from quasilpv.systems.robots.tree import KinematicTree

ROUNDING = 1e-6
"""Descriptions print inertias with few digits: what they break by less, relative to the largest moment, is rounding."""

SMALLEST_BODY_M = 0.1
"""No body is taken to be smaller than this when its inertia is compared with its size."""


@dataclass(frozen=True)
class Concern:
    """Something about a body that a person should look at.

    Attributes:
        joint: name of the joint that carries the body.
        text: what, with numbers.
    """

    joint: str
    text: str


def require_bodies(tree: KinematicTree, source: str, *, accept_triangle: bool = False) -> None:
    """Refuse inertias that no body has.

    Args:
        tree: the robot, rotor inertias included.
        source: what to name in errors.
        accept_triangle: let principal moments pass of which one exceeds the sum of the others; the kinetic energy is
            still positive then, but no distribution of mass has such moments.

    Raises:
        InputError: a body moves with neither mass nor rotor inertia, has a negative kinetic energy, or (unless
            accepted) principal moments that break the triangle inequality.
    """
    for joint in tree.joints:
        body, field = joint.inertia, f"joint {joint.name}"
        if body.mass_kg == 0.0 and joint.rotor_inertia_kg_m2 == 0.0:
            raise InputError(source, field, "a body without mass and a rotor without inertia", "one of them above 0")
        largest = float(np.abs(np.linalg.eigvalsh(body.about_its_com_kg_m2)).max())
        moments = np.linalg.eigvalsh(body.about_its_com_kg_m2)
        if body.mass_kg < 0.0 or moments[0] < -ROUNDING * largest:
            got = f"mass {body.mass_kg:.4g} kg, smallest principal moment {moments[0]:.3g} kg m^2"
            raise InputError(source, field, got, "a body of positive kinetic energy")
        if body.triangle_excess > ROUNDING * largest and not accept_triangle:
            got = f"principal moments {', '.join(f'{m:.4g}' for m in moments)} kg m^2"
            expected = "none above the sum of the other two; --accept-inertias takes them as they are"
            raise InputError(source, field, got, expected)


def concerns(tree: KinematicTree) -> tuple[Concern, ...]:
    """Bodies whose moment of inertia is larger than their size allows, and other things that are hardly meant."""
    found = []
    for k, joint in enumerate(tree.joints):
        following = tree.joints[k + 1].placement if k + 1 < tree.order else tree.tool
        size = max(
            SMALLEST_BODY_M,
            float(np.linalg.norm(joint.inertia.com_m)),
            float(np.linalg.norm(following.translation_m)),
        )
        radius = joint.inertia.radius_of_gyration_m
        if radius > size:
            text = f"radius of gyration {radius:.3g} m in a body of about {size:.2g} m: is its inertia in another unit?"
            found.append(Concern(joint.name, text))
        if joint.rotor_inertia_kg_m2 == 0.0:
            found.append(Concern(joint.name, "rotor inertia 0: true of direct drives only"))
    return tuple(found)
