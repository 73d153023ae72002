"""Inequalities that several discrete-time conditions share."""

from __future__ import annotations

from fractions import Fraction

from quasilpv.lmi import Expression, block
from quasilpv.lmi.expressions import Operand, as_expression


def pole_disk(lyapunov: Operand, product: Operand, centre: Fraction, radius: Fraction) -> Expression:
    """Positive if and only if the poles lie in the open disk ``|z - centre| < radius``.

    ``[[r P, (X - c P)'], [X - c P, r P]] > 0`` with ``X = A P`` (or ``X = Q A`` in observer form): the Lyapunov
    inequality of ``(A - c I) / r`` (Chilali and Gahinet 1996, LMI regions).

    Args:
        lyapunov: ``P`` or ``Q``, n x n symmetric.
        product: ``X``, n x n, affine in the unknowns.
        centre: c, on the real axis.
        radius: r > 0.
    """
    matrix = as_expression(lyapunov)
    shifted = as_expression(product) - matrix * centre
    return block([[matrix * radius, None], [shifted, matrix * radius]])
