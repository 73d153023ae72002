"""From an artifact, as a plain document, to the exact data the robust gate works on."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from flint import fmpq, fmpq_mat

from quasilpv.certificate.gate_inertia import InertiaBlock, InertiaData, Pair
from quasilpv.certificate.gate_loop import AccelerationLoopData
from quasilpv.certificate.gate_mechanism import DiscData, MechanismData, mechanism_data
from quasilpv.errors import InputError

LAW_KIND = "dob-acceleration"
HALF_A_SAMPLE = fmpq(1, 2)
"""The transport delay a gate asks for if nobody says otherwise."""

DISC_RULE = {"fraction": [0.0, 1.0]}
PAYLOAD_RULE = {"inertia_about_com": "unchanged", **DISC_RULE}


def law_kind(document: Mapping[str, Any], source: str, known: Collection[str]) -> str:
    """The law kind of an artifact, one of those given.

    Raises:
        InputError: another one.
    """
    kind = document["law"]["kind"]
    if kind not in known:
        raise InputError(source, "law.kind", kind, f"one with this gate: {', '.join(known)}")
    return str(kind)


def loop_data(document: Mapping[str, Any], source: str = "artifact") -> AccelerationLoopData:
    """The scalar loop of an artifact.

    Args:
        document: the artifact as a JSON tree.
        source: what to call it in errors.

    Raises:
        InputError: another law than `dob-acceleration`, whose loop does not decouple into one scalar loop.
    """
    law_kind(document, source, (LAW_KIND,))
    law = document["law"]
    feedback = law["feedback"]
    l1, l2, l3, l4 = (float(gain) for gain in law["observer"])
    return AccelerationLoopData(
        sample_period_s=float(document["sample_period_s"]),
        kp=float(feedback["kp"]),
        kd=float(feedback["kd"]),
        ki=float(feedback["ki"]),
        observer=(l1, l2, l3, l4),
        filter_time_constant_s=float(law["filter_time_constant_s"]),
        disturbance_compensation=bool(law["disturbance_compensation"]),
    )


def inertia_data(document: Mapping[str, Any], source: str = "artifact") -> InertiaData:
    """The true and the design inertia of an artifact; one that is the same at every vertex has no premises here.

    Args:
        document: the artifact as a JSON tree.
        source: what to call it in errors.

    Raises:
        InputError: the robot is none of `gate_mechanism`, the payload set is another one than `PAYLOAD_RULE` describes,
            or a premise is not the cosine of a difference of absolute angles.
    """
    mechanism = mechanism_data(document["robot"]["parameters"], source)
    mass_scale, com_scale = _payload_scales(document["payloads"], mechanism, source)
    inertia = document["law"]["inertia"]
    blocks = tuple(
        InertiaBlock(
            tuple(block["premises"]),
            tuple(tuple(tuple(map(float, row)) for row in vertex) for vertex in block["vertices"]),
        )
        for block in inertia["blocks"]
    )
    lower, upper = (tuple(map(float, inertia[name])) for name in ("lower", "upper"))
    code = document["programs"]["premises"]["code"]
    vertices = {vertex for block in blocks for vertex in block.vertices}
    if len(vertices) == 1:
        blocks, lower, upper, code = (InertiaBlock((), tuple(vertices)),), (), (), []
    return InertiaData(
        mechanism=mechanism,
        mass_scale=mass_scale,
        com_scale=com_scale,
        angle_rad=tuple((float(low), float(high)) for low, high in document["domain"]["angle_rad"]),
        premise_lower=lower,
        premise_upper=upper,
        premise_pairs=cosine_pairs(code, mechanism.absolute_map, source),
        blocks=blocks,
    )


def _payload_scales(
    payloads: Mapping[str, Any], mechanism: MechanismData, source: str
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Factors of masses and of distances to centres of mass at payload fraction 1; of a disc, of its inertia and 1."""
    rules = DISC_RULE if isinstance(mechanism, DiscData) else PAYLOAD_RULE
    for field, rule in rules.items():
        if payloads.get(field) != rule:
            raise InputError(source, f"payloads.{field}", payloads.get(field), str(rule))
    if isinstance(mechanism, DiscData):
        return (float(payloads["inertia_scale"]),), (1.0,)
    return tuple(map(float, payloads["mass_scale"])), tuple(map(float, payloads["com_scale"]))


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
