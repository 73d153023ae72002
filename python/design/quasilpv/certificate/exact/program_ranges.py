"""The range of a program over a box of what it reads, by ball arithmetic over a subdivision: proved, not sampled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isfinite, nextafter

from flint import arb

from quasilpv.certificate.exact.claims import Claim
from quasilpv.certificate.exact.program_chords import CHORDS
from quasilpv.certificate.exact.program_values import Code, program_values

LARGEST_SUBDIVISION = 200_000

PIECES = 256
"""Into which a domain is divided where a range is looked for."""

Domain = Mapping[str, Sequence[Sequence[float]]]
"""Intervals of what a program reads: of ``angle`` and ``speed`` by joint, or of ``signal`` by number."""

_POPS = {
    **dict.fromkeys(("const", "angle", "speed", "signal"), 0),
    **dict.fromkeys(("add", "sub", "mul", "div", "atan2", "min", "max", *CHORDS), 2),
}


def outputs_of(program: Code) -> list[Code]:
    """The program taken apart, one for each output: the shortest final pieces that leave one value each."""
    code = list(program)
    pieces: list[Code] = []
    while code:
        missing, start = 1, len(code)
        while missing:
            start -= 1
            missing += _POPS.get(code[start][0], 1) - 1
        pieces.append(code[start:])
        del code[start:]
    return pieces[::-1]


def range_claim(title: str, code: Code, domain: Domain, box: tuple[float, float]) -> Claim:
    """The claim that the one output of a program stays in an interval.

    The domain is divided, along inputs that occur, until every piece is seen to stay inside, or the middle of one to be
    outside.

    Args:
        title: of the claim.
        code: leaves one value.
        domain: intervals of all inputs.
        box: lower and upper bound.
    """
    used = sorted({(op[0], int(op[1])) for op in code if op[0] in domain})
    whole = {key: (float(domain[key[0]][key[1]][0]), float(domain[key[0]][key[1]][1])) for key in used}
    wide = [key for key in used if whole[key][0] < whole[key][1]]
    pending = [whole]
    for _ in range(LARGEST_SUBDIVISION):
        if not pending:
            return Claim.enclosed(title, holds=True, margin=1.0)
        piece = pending.pop()
        value = _enclosure(code, domain, piece)
        if value.lower() >= box[0] and value.upper() <= box[1]:
            continue
        middle = _enclosure(code, domain, {key: ((low + high) / 2.0,) * 2 for key, (low, high) in piece.items()})
        if not wide or middle.upper() < box[0] or middle.lower() > box[1]:
            break
        widest = max(wide, key=lambda key: (piece[key][1] - piece[key][0]) / (whole[key][1] - whole[key][0]))
        pending += [{**piece, widest: half} for half in _halves(piece[widest])]
    return Claim.enclosed(title, holds=False, margin=-1.0)


def range_of(code: Code, domain: Domain, box: tuple[float, float]) -> tuple[float, float] | None:
    """An interval that holds a box and the values of a program over a domain: the box if that is seen to do.

    Args:
        code: leaves one value.
        domain: intervals of all inputs.
        box: lower and upper bound.

    Returns:
        None if a value could not be enclosed.
    """
    if range_claim("", code, domain, box).holds:
        return box
    used = sorted({(op[0], int(op[1])) for op in code if op[0] in domain})
    pieces = [{key: (float(domain[key[0]][key[1]][0]), float(domain[key[0]][key[1]][1])) for key in used}]
    while len(pieces) < PIECES:
        key = used[len(pieces).bit_length() % len(used)]
        pieces = [{**piece, key: half} for piece in pieces for half in _halves(piece[key])]
    balls = [_enclosure(code, domain, piece) for piece in pieces]
    ends = min(box[0], *(float(ball.lower()) for ball in balls)), max(box[1], *(float(ball.upper()) for ball in balls))
    if not (isfinite(ends[0]) and isfinite(ends[1])):
        return None
    return float(nextafter(ends[0], -inf)), float(nextafter(ends[1], inf))


def _halves(interval: tuple[float, float]) -> tuple[tuple[float, float], tuple[float, float]]:
    low, high = interval
    return (low, (low + high) / 2.0), ((low + high) / 2.0, high)


def _enclosure(code: Code, domain: Domain, piece: Mapping[tuple[str, int], tuple[float, float]]) -> arb:
    """The value over a piece; inputs that do not occur are nowhere read."""
    balls = {
        name: [
            arb(piece[name, k][0]).union(arb(piece[name, k][1])) if (name, k) in piece else arb(0)
            for k in range(len(intervals))
        ]
        for name, intervals in domain.items()
    }
    value: arb
    (value,) = program_values(code, **balls)
    return value
