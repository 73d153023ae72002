"""The inertias of an artifact, true and of the design, as the exact data that proofs work on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flint import fmpq_mat

from quasilpv.certificate.reading import Shipped
from quasilpv.certificate.robot.inertia import InertiaBlock, InertiaData, Pair
from quasilpv.certificate.robot.registry import exact_robot
from quasilpv.documents.tables import PolytopeTable
from quasilpv.errors import InputError

PREMISES = "premises"


def inertia_table(shipped: Shipped[Any]) -> PolytopeTable:
    """The design inertia of a law that has a table.

    Raises:
        InputError: it has another.
    """
    table = shipped.law.inertia
    if not isinstance(table, PolytopeTable):
        raise InputError(shipped.source, "law.inertia.kind", table.kind, "a table here")
    return table


def inertia_data(shipped: Shipped[Any]) -> InertiaData:
    """The true and the design inertia of an artifact; one that is the same at every vertex has no premises here.

    Args:
        shipped: the artifact.

    Raises:
        InputError: the robot is none of `robot.registry`, its payload set is not one that its kind has, or a premise is
            not the cosine of a difference of absolute angles.
    """
    table = inertia_table(shipped)
    robot = exact_robot(shipped.mechanism, shipped.source)
    mass_scale, com_scale = shipped.payloads.scales
    blocks = tuple(InertiaBlock(block.premises, block.vertices) for block in table.blocks)
    lower, upper, code = table.lower, table.upper, shipped.program(PREMISES).code
    vertices = {vertex for block in blocks for vertex in block.vertices}
    if len(vertices) == 1:
        blocks, lower, upper, code = (InertiaBlock((), tuple(vertices)),), (), (), ()
    return InertiaData(
        mechanism=robot,
        mass_scale=mass_scale,
        com_scale=com_scale,
        angle_rad=shipped.artifact.domain.angle_rad,
        premise_lower=lower,
        premise_upper=upper,
        premise_pairs=cosine_pairs(code, robot.absolute_map, shipped.source),
        blocks=blocks,
    )


def cosine_pairs(code: Sequence[Sequence[Any]], absolute_map: fmpq_mat, source: str = "artifact") -> tuple[Pair, ...]:
    """Read off a program of premises which cosine each of its outputs is.

    The program is run on sums of joint angles instead of numbers: it may add, subtract and negate angles, and take
    cosines ``cos(alpha_l - alpha_k)`` of differences of absolute angles.

    Args:
        code: the postfix program, as in an artifact.
        absolute_map: S, ``alpha = S theta``.
        source: what to call it in errors.

    Returns:
        The pair (k, l), k < l, of every output, joints counted from 0.

    Raises:
        InputError: the program computes something else.
    """
    angles: list[dict[int, int]] = []
    pairs: list[Pair] = []
    for name, *argument in code:
        match name:
            case "angle":
                angles.append({int(argument[0]): 1})
            case "neg" if angles:
                angles.append(_combined({}, -1, angles.pop()))
            case "add" | "sub" if len(angles) > 1:
                right = angles.pop()
                angles.append(_combined(angles.pop(), 1 if name == "add" else -1, right))
            case "cos" if len(angles) == 1:
                pairs.append(_pair(angles.pop(), absolute_map, source))
            case _:
                raise InputError(source, "programs.premises", name, "only cosines of sums of joint angles")
    if angles:
        raise InputError(source, "programs.premises", "an angle as output", "only cosines of sums of joint angles")
    return tuple(pairs)


def _combined(left: Mapping[int, int], sign: int, right: Mapping[int, int]) -> dict[int, int]:
    """``left + sign * right`` as integer multiples of joint angles, zero multiples dropped."""
    total = {joint: left.get(joint, 0) + sign * right.get(joint, 0) for joint in left.keys() | right.keys()}
    return {joint: factor for joint, factor in total.items() if factor}


def _pair(angle: Mapping[int, int], absolute_map: fmpq_mat, source: str) -> Pair:
    """The pair of a difference of absolute angles; a cosine does not see its sign."""
    n = absolute_map.nrows()
    if all(joint < n for joint in angle):
        multiples = (fmpq_mat(1, n, [angle.get(joint, 0) for joint in range(n)]) * absolute_map.inv()).entries()
        involved = [k for k, factor in enumerate(multiples) if factor]
        if len(involved) == 2 and sorted(multiples[k] for k in involved) == [-1, 1]:
            return involved[0], involved[1]
    got = " ".join(f"{factor:+d} theta_{joint + 1}" for joint, factor in sorted(angle.items()))
    raise InputError(source, "programs.premises", f"cos({got})", "the cosine of a difference of absolute link angles")
