"""Exact check that a law's tree belongs to its robot: bounds of the inertia, and the torque of gravity.

* **inertia**: both sides of the needed range (`tree_range`), with the bounds and storages of the witness.
* **gravity**: the law's torque of gravity is that of the robot with a share of its load in the middle of its box. The
  torque of a body is linear in its mass and first moment times the vector of gravity, so these products are compared,
  in rational arithmetic: the law scales bodies and gravity against each other.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol

from flint import fmpq

from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.rationals import to_float
from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot.tree import TreeData, central_load
from quasilpv.certificate.robot.tree_range import SideProof, TreePair, TreeWitness
from quasilpv.documents.mechanism import Tree

ROUNDING = fmpq(1, 1 << 40)
"""Largest deviation, relative to the largest product: about 9e-13."""


def check_tree_model(shipped: Shipped[Any]) -> tuple[Claim, ...]:
    """Claims of an artifact for a robot in space.

    Raises:
        InputError: the law's chain moves otherwise than the robot's, or the witness is not of the documented form.
        ValueError: the storages are not as many as the chain needs.
    """
    data, witness = TreeData.of(shipped), shipped.witness(TreeWitness).chain
    pair = TreePair(data)
    return (
        _bound("lowest", pair.prove("lowest", witness.lowest)),
        _bound("highest", pair.prove("highest", witness.highest)),
        *_gravity(shipped, data),
    )


def _bound(side: str, found: SideProof) -> Claim:
    sign = ">" if side == "lowest" else "<"
    where = "" if found.proof.holds else f", refused at joint {found.proof.failed_joint}"
    title = f"inertia: M_t {sign} {to_float(found.bound):.6g} M_n over all postures and loads{where}"
    return Claim.enclosed(title, found.proof.holds, 1.0 if found.proof.holds else -1.0)


def _gravity(shipped: Shipped[Any], data: TreeData) -> Iterator[Claim]:
    """Products of the parameters (m, h) of every body with gravity, of the law and of the robot."""
    law, robot = shipped.law, shipped.mechanism
    assert isinstance(robot, Tree)  # as `TreeData.of` found
    own, design = ([_mass_and_moment(joint) for joint in tree.chain] for tree in (robot, law.inertia))
    carried = law.gravity_load
    if carried is not None:
        design[-1] = [a + b for a, b in zip(design[-1], _mass_and_moment(carried), strict=True)]
    g_own, g_design = data.nominal.gravity, data.design.gravity
    share = fmpq(0)
    if carried is not None and data.load is not None:
        axis = max(range(3), key=lambda i: abs(g_own[i]))
        if g_own[axis]:
            mass = design[-1][0] * g_design[axis] / g_own[axis]
            share = max(fmpq(0), min(fmpq(1), (mass - own[-1][0]) / rational(data.load.mass_kg)))
        load = central_load(data.load, share)
        moment = [load[5, 1], load[3, 2], load[4, 0]]  # h from [h]
        own[-1] = [a + b for a, b in zip(own[-1], [load[0, 0], *moment], strict=True)]
    worst, largest = fmpq(0), fmpq(0)
    for mine, its in zip(own, design, strict=True):
        for x, y in zip(mine, its, strict=True):
            for a, b in zip(g_own, g_design, strict=True):
                worst, largest = max(worst, abs(x * a - y * b)), max(largest, abs(x * a))
    title = f"gravity: that of the robot with {to_float(share):.3g} of its load"
    if largest == 0:
        yield Claim.enclosed(title, worst == 0, 1.0 if worst == 0 else -1.0)
    else:
        yield Claim.at_most(title, worst, largest * ROUNDING)


class _Body(Protocol):
    @property
    def mass_kg(self) -> float: ...

    @property
    def first_moment_kg_m(self) -> tuple[float, float, float]: ...


def _mass_and_moment(body: _Body) -> list[fmpq]:
    return [rational(body.mass_kg), *(rational(x) for x in body.first_moment_kg_m)]
