"""Slack matrices: additions to the entries of a sum over vertices whose weighted mean is zero by construction.

The weights of every block of a block polytope sum to 1/G, so ``sum_i w_i (T_b(i) - (1/G) sum_b T_b) = 0`` whatever the
T_b, G blocks. With a single block every such addition vanishes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product

import numpy as np
import numpy.typing as npt

from quasilpv.conditions.choices import Slack as Slack  # noqa: PLC0414 -- also from here
from quasilpv.lmi import Expression, Variable, zeros

Indices = tuple[int, ...]
Shares = dict[Variable, Fraction]


@dataclass(frozen=True, eq=False)
class SlackFamily:
    """Symmetric unknowns, and how much of each is added to an entry of a sum.

    Attributes:
        variables: the unknowns.
        share: from the indices of an entry to the coefficient of every unknown that takes part.
        size: of the unknowns.
    """

    variables: tuple[Variable, ...]
    share: Callable[[tuple[int, ...]], dict[Variable, Fraction]]
    size: int
    _multiples: dict[tuple[Variable, Fraction], Expression] = field(default_factory=dict, repr=False)

    def at(self, indices: tuple[int, ...]) -> Expression:
        """What is added to one entry."""
        return self.sum({indices: Fraction(1)})

    def sum(self, factors: dict[tuple[int, ...], Fraction]) -> Expression:
        """What is added to a combination of entries, every unknown once."""
        total: dict[Variable, Fraction] = {}
        for indices, factor in factors.items():
            for variable, coefficient in self.share(indices).items():
                total[variable] = total.get(variable, Fraction(0)) + factor * coefficient
        terms = (self._scaled(T, coefficient) for T, coefficient in total.items() if coefficient)
        return sum(terms, zeros(self.size, self.size))

    def _scaled(self, variable: Variable, factor: Fraction) -> Expression:
        """A multiple of an unknown; few factors occur, in many entries."""
        key = (variable, factor)
        if key not in self._multiples:
            self._multiples[key] = variable * factor
        return self._multiples[key]


def slack_family(slack: Slack, name: str, blocks: npt.NDArray[np.intp] | None, size: int, sums: int) -> SlackFamily:
    """The unknowns of a family, and their shares.

    Args:
        slack: which family; the full one gives sums beyond the second slack as the thesis does.
        name: of the inequalities.
        blocks: block of every vertex; None for no slack.
        size: of an entry.
        sums: number of indices of an entry.
    """
    if blocks is None or slack is Slack.NONE or len(set(blocks.tolist())) == 1:
        return SlackFamily((), lambda indices: {}, size)
    if slack is Slack.PAIRS:
        return _joint(name, blocks, size, sums)
    if slack is Slack.FULL and sums > 1:
        return _per_vertex(name, blocks, size, sums)
    return _separate(name, blocks, size, tuple(range(sums)))


def _separate(name: str, blocks: npt.NDArray[np.intp], size: int, places: Sequence[int]) -> SlackFamily:
    """``sum_s (T^s_b(i_s) - (1/G) sum_b T^s_b)``, one T^s_b per place s among the indices and block b."""
    groups = _groups(blocks)
    unknowns = {s: {b: Variable(f"{'TSUVW'[s]} {name} {b}", size, symmetric=True) for b in groups} for s in places}

    def share(indices: Indices) -> Shares:
        return {
            T: Fraction(int(b == blocks[indices[s]])) - Fraction(1, len(groups))
            for s, own in unknowns.items()
            for b, T in own.items()
        }

    return SlackFamily(tuple(T for own in unknowns.values() for T in own.values()), share, size)


def _joint(name: str, blocks: npt.NDArray[np.intp], size: int, sums: int) -> SlackFamily:
    """``T_b(i),b(j),... - (1/G^k) sum T``, one T per tuple of blocks."""
    tuples = list(product(_groups(blocks), repeat=sums))
    T = {group: Variable(f"T {name} {' '.join(map(str, group))}", size, symmetric=True) for group in tuples}

    def share(indices: Indices) -> Shares:
        own = tuple(int(blocks[index]) for index in indices)
        return {variable: Fraction(int(group == own)) - Fraction(1, len(T)) for group, variable in T.items()}

    return SlackFamily(tuple(T.values()), share, size)


def _per_vertex(name: str, blocks: npt.NDArray[np.intp], size: int, sums: int) -> SlackFamily:
    """``T_i,b(j) - (1/G) sum_b T_i,b`` on the first two indices, separate unknowns on the others."""
    groups = _groups(blocks)
    rows = [{b: Variable(f"T {name} {i} {b}", size, symmetric=True) for b in groups} for i in range(len(blocks))]
    others = _separate(name, blocks, size, range(2, sums))

    def share(indices: Indices) -> Shares:
        i, j = indices[:2]
        own = {T: Fraction(int(b == blocks[j])) - Fraction(1, len(groups)) for b, T in rows[i].items()}
        return own | others.share(indices)

    return SlackFamily(tuple(T for row in rows for T in row.values()) + others.variables, share, size)


def _groups(blocks: npt.NDArray[np.intp]) -> list[int]:
    return sorted(set(blocks.tolist()))
