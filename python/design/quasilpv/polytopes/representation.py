"""Representations by the name under which a user asks for them."""

from __future__ import annotations

import numpy as np

from quasilpv.defaults import REPRESENTATIONS
from quasilpv.errors import InputError
from quasilpv.polytopes.block_polytope import BlockPolytope
from quasilpv.polytopes.model import PolytopicModel, unknown_premises
from quasilpv.systems.descriptor.system import DescriptorSystem

AT_ZERO = "@0"
"""Suffix that centres blocks at z = 0, as Dehak 2022, (II.10) does, instead of at the centre of the box."""


def polytopic_model(system: DescriptorSystem, representation: str) -> PolytopicModel:
    """A system in the representation of that name.

    * ``ts``: one box of all r premises, 2^r vertices; of a system given by rules the same as ``rules``
    * ``rules``: of a system given by rules (`DescriptorSystem.from_rules`), one vertex per rule
    * ``reduced``: one simplex, r + 1 vertices
    * ``per-premise``: a box per premise, 2 r vertices
    * ``uncertain``: the same, for a system with unknown premises
    * ``grouped=0,1+2``: a box per group, the sum of 2^size vertices

    With the suffix ``@0`` the vertices are centred at z = 0 instead of at the centre of the box: another representation
    of the same matrices, for double sums not equivalent even with slack (a single block has no centre).

    Whatever the representation, a controller is given no unknown premise.

    Raises:
        InputError: there is no such representation, the groups are no partition of the premises, or ``uncertain`` is
            asked of a system without unknown premises.
    """
    low, high, unknown = system.lower, system.upper, unknown_premises(system)
    centre = np.zeros(low.shape) if representation.endswith(AT_ZERO) else None
    name, _, groups = representation.removesuffix(AT_ZERO).partition("=")
    if name == "uncertain" and not unknown:
        raise InputError(system.name, "representation", representation, "a system with unknown premises")
    if name == "grouped" and groups:
        polytope = BlockPolytope.grouped(low, high, _partition(groups), centre=centre, unknown=unknown)
    elif name in {"per-premise", "uncertain"} and not groups:
        polytope = BlockPolytope.per_premise(low, high, centre=centre, unknown=unknown)
    elif name in {"ts", "rules"} and not groups and system.given_by_rules:
        polytope = BlockPolytope.of_rules(low, high, unknown=unknown)
    elif name == "rules" and not groups:
        raise InputError(system.name, "representation", representation, "a system given by rules; of others, ts")
    elif name == "ts" and not groups:
        polytope = BlockPolytope.takagi_sugeno(low, high, unknown=unknown)
    elif name == "reduced" and not groups:
        polytope = BlockPolytope.reduced_affine(low, high, unknown=unknown)
    else:
        raise InputError("command line", "representation", representation, f"one of {', '.join(REPRESENTATIONS)}")
    return PolytopicModel(system, polytope)


def _partition(groups: str) -> list[list[int]]:
    try:
        return [[int(premise) for premise in group.split("+")] for group in groups.split(",")]
    except ValueError:
        expected = "premise numbers joined by + and separated by commas"
        raise InputError("command line", "representation", f"grouped={groups}", expected) from None
