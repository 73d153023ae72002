"""One convex representation for every matrix affine in premises of a box: the block polytope.

A matrix ``X(z) = X_0 + sum_p z_p X_p`` with ``lower <= z <= upper`` is written exactly as ``X(z) = sum_i w_i(z) X_i``
with weights ``w_i >= 0``. The premises are split into G blocks; the weights of every block sum to 1/G, and with
centring point zc the vertices of a block b are

    X_i = X(zc) + G * sum_{p in b} (c_ip - zc_p) X_p,

c_i being the vertices of a polytope around the block's own sub-box: its corners for a *box* block (2^g vertices for g
premises, weights products of ``omega_p = (z_p - lower_p)/(upper_p - lower_p)`` and ``1 - omega_p``), or the g + 1
points of Dehak 2022, Theorem I.4 for a *simplex* block (weights affine in the omega_p).

| representation | blocks | vertices |
|---|---|---|
| `BlockPolytope.takagi_sugeno`: sector nonlinearity, Dehak 2022, (I.4)-(I.7) | one box of all r premises | 2^r |
| `BlockPolytope.per_premise`: Dehak 2022, (II.6)-(II.10) | r boxes of one premise | 2 r |
| `BlockPolytope.uncertain`: Dehak 2022, (III.3)-(III.9) | r + l boxes of one premise, l of them unknown | 2 (r + l) |
| `BlockPolytope.reduced_affine`: Dehak 2022, Lemma I.6 and Theorem I.4 | one simplex | r + 1 |
| `BlockPolytope.of_rules`: Takagi-Sugeno models given as rules | one of memberships | one per rule |
| `BlockPolytope.grouped`: any partition | boxes of chosen size | sum of 2^size |

Vertex order: blocks in order; inside a box block the first listed premise is the most significant bit and bit 0 means
the lower bound; inside a simplex block the order of Lemma I.6's index set, {1, 2, 3, 7, ..., 2^g - 1}.

With blocks of one premise, `S_p >= +-radius_p X_p`, `X(zc) + sum S_p < 0` (the matrix-cube relaxation of Ben-Tal and
Nemirovski, 2002) and "all vertices plus slack negative" are the same condition: its conservatism is bounded a priori by
a factor that depends on the largest rank of the X_p (pi/2 for rank 2) and not on the number of premises.
"""

from quasilpv.polytopes.block import Block
from quasilpv.polytopes.block_polytope import BlockPolytope
from quasilpv.polytopes.model import PolytopicModel
from quasilpv.polytopes.multilinear import MultilinearForm
from quasilpv.polytopes.representation import polytopic_model

__all__ = ["Block", "BlockPolytope", "MultilinearForm", "PolytopicModel", "polytopic_model"]
