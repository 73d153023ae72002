"""How fast the inertia of a chain of bodies can change, proved by one small matrix inequality per joint.

Along a motion q(t) and for constant w the form ``w' M(q) w`` is ``sum_k v_k' I_k v_k + r_k w_k^2`` with the twists v_k
of `quasilpv.certificate.exact.chain`, and its derivative ``sum_k 2 v_k' I_k u_k`` with ``u_k = dv_k/dt``,

    u_k = X_k(q_k) u_(k-1) + q_k' (dX_k/dq_k) v_(k-1),    u_1 = 0.

So ``dM/dt < beta M`` for all ``|q_k'| <= omega_k`` if the form

    sum_k beta v_k' I_k v_k - 2 v_k' I_k u_k + beta r_k w_k^2

is positive, and that holds if there are a scalar z_1 and symmetric 12 x 12 storages Z_2 .. Z_(n-1) of (v, u), Z_n = 0,
with ``D_k = [[beta I_k, -I_k], [-I_k, 0]]`` and, at both ends ``s = +-omega_k`` and for all q_k in joint k's interval,

    k = 1:  S_1' beta I_1 S_1 + z_1 + beta r_1 > 0
    k = 2:  T' (D_2 + Z_2) T + diag(-z_1, beta r_2) > 0,            T = [[X_2 S_1, S_2], [s X_2' S_1, 0]]    12 x 2
    k > 2:  T' (D_k + Z_k) T + blkdiag(-Z_(k-1), beta r_k) > 0,     T = [[X_k, 0, S_k], [s X_k', X_k, 0]]    12 x 13
    k < n:  the part of Z_k that belongs to u is negative definite.

The last makes the inequality concave in the speed: what holds at both ends holds between them. The joint that turns the
whole chain, the first, does not change its inertia.

Then ``M(q+) <= exp(beta t) M(q)`` for two postures that a motion of duration t joins within the intervals and speeds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from flint import fmpq, fmpq_mat

from quasilpv.certificate.exact.chain import (
    ChainJoint,
    ChainProof,
    Chart,
    Polynomial,
    block_diagonal,
    prove_joints,
)
from quasilpv.certificate.exact.matrices import identity, is_positive_definite, is_symmetric, stack, zero

PAIR = 12
"""Of a twist and its derivative."""


@dataclass(frozen=True)
class RateForm:
    """The claim ``dM/dt < beta M``.

    Attributes:
        bodies: I_k, 6 x 6.
        rotors: r_k.
        rate: beta, 1/s.
        speeds: omega_k >= 0, rad/s.
    """

    bodies: Sequence[fmpq_mat]
    rotors: Sequence[fmpq]
    rate: fmpq
    speeds: Sequence[fmpq]

    def body(self, k: int) -> fmpq_mat:
        """D_k."""
        own = self.bodies[k]
        return stack([[own * self.rate, own * fmpq(-1)], [own * fmpq(-1), zero(6, 6)]])


def prove_rate(joints: Sequence[ChainJoint], form: RateForm, storages: Sequence[fmpq_mat]) -> ChainProof:
    """Decide the inequalities exactly.

    Args:
        joints: base to tip, n of them.
        form: what is claimed.
        storages: z_1 as a 1 x 1 matrix, Z_2 .. Z_(n-1), n - 1 matrices; symmetric, or the proof fails.

    Raises:
        ValueError: there are not n bodies, rotors and speeds and n - 1 storages, or one is of another size.
    """
    n = len(joints)
    if not n == len(form.bodies) == len(form.rotors) == len(form.speeds) == len(storages) + 1:
        raise ValueError("prove_rate: joints, bodies, rotors, speeds and storages do not belong together")
    for k, storage in enumerate(storages):
        size = 1 if k == 0 else PAIR
        if (storage.nrows(), storage.ncols()) != (size, size):
            raise ValueError(f"prove_rate: storage {k} is not {size} x {size}")
    for k, storage in enumerate(storages):
        if not is_symmetric(storage) or (k > 0 and not is_positive_definite(_of_rates(storage) * fmpq(-1))):
            return ChainProof(False, 0, k + 1)
    return prove_joints(_inequalities(k, joints, form, storages) for k in range(n))


def _inequalities(
    k: int, joints: Sequence[ChainJoint], form: RateForm, storages: Sequence[fmpq_mat]
) -> Iterator[tuple[Polynomial, Chart]]:
    """The inequality of joint k (from 0) at both ends of its speed, chart by chart."""
    twist, rotor = joints[k].twist, fmpq_mat(1, 1, [form.rotors[k] * form.rate])
    if k == 0:
        ahead = storages[0] if storages else zero(1, 1)
        yield (twist.transpose() * form.bodies[0] * twist * form.rate + ahead + rotor,), Chart.point()
        return
    stored = form.body(k) + storages[k] if k < len(storages) else form.body(k)
    constant = block_diagonal(storages[k - 1] * fmpq(-1), rotor)
    before = joints[0].twist if k == 1 else identity(6)
    for chart in joints[k].charts():
        for speed in dict.fromkeys((form.speeds[k], -form.speeds[k])):
            columns = list(_columns(chart, before, twist, speed, with_rates=k > 1))
            yield chart.congruence(columns, stored, constant), chart


def _columns(chart: Chart, before: fmpq_mat, twist: fmpq_mat, speed: fmpq, *, with_rates: bool) -> Iterator[fmpq_mat]:
    """Coefficients of ``weight T``."""
    for i in range(max(len(chart.motion), len(chart.weight))):
        moved = chart.motion[i] * before if i < len(chart.motion) else zero(6, before.ncols())
        turned = chart.turning[i] * before * speed if i < len(chart.turning) else zero(6, before.ncols())
        own = twist * (chart.weight[i] if i < len(chart.weight) else fmpq(0))
        none = zero(6, before.ncols())
        if with_rates:
            yield stack([[moved, none, own], [turned, moved, zero(6, 1)]])
        else:
            yield stack([[moved, own], [turned, zero(6, 1)]])


def _of_rates(storage: fmpq_mat) -> fmpq_mat:
    """The lower right 6 x 6 block."""
    return fmpq_mat(6, 6, [storage[i, j] for i in range(6, PAIR) for j in range(6, PAIR)])
