"""Exact algebra on the unit circle: which real polynomials are Schur, and where ``F + mu G`` has a root on the circle.

Polynomials have rational coefficients (flint's `fmpq_poly`, ascending powers of z). Nothing here rounds, except the
enclosures of irrational numbers, which are balls of Arb arithmetic and contain the number they stand for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flint import arb, arb_poly, ctx, fmpq, fmpq_poly, fmpz_poly

PRECISION_BITS = 384


def is_schur(polynomial: fmpq_poly) -> bool:
    """Whether all roots lie strictly inside the unit circle, decided in rational arithmetic.

    Schur-Cohn recursion, the table of Jury: with ``k = p(0) / leading coefficient`` and ``p*(z) = z^n p(1/z)``, p is
    Schur if and only if ``|k| < 1`` and ``(p - k p*) / z``, of one degree less, is.

    Args:
        polynomial: not zero.

    Reference: Jury (1964), Theory and Application of the z-Transform Method, chapter 3.
    """
    coefficients = list(polynomial.coeffs())
    while len(coefficients) > 1:
        ratio = coefficients[0] / coefficients[-1]
        if ratio * ratio >= 1:
            return False
        reflected = coefficients[::-1]
        coefficients = [a - ratio * b for a, b in zip(coefficients[1:], reflected[1:], strict=True)]
    return True


def is_schur_enclosed(polynomial: arb_poly) -> bool:
    """The same for ball coefficients: True is proved for every polynomial in the balls, False says nothing.

    Args:
        polynomial: its leading coefficient contains no zero.
    """
    coefficients = list(polynomial.coeffs())
    while len(coefficients) > 1:
        ratio = coefficients[0] / coefficients[-1]
        if not abs(ratio) < 1:
            return False
        reflected = coefficients[::-1]
        coefficients = [a - ratio * b for a, b in zip(coefficients[1:], reflected[1:], strict=True)]
    return True


@dataclass(frozen=True)
class CircleProduct:
    """``F(z) conj(G(z))`` for ``z = e^(i phi)``, as polynomials in ``c = cos(phi)``.

    Attributes:
        real: A with ``Re(F conj G) = A(c)``.
        imaginary: B with ``Im(F conj G) = sin(phi) B(c)``.
    """

    real: fmpq_poly
    imaginary: fmpq_poly

    @classmethod
    def of(cls, F: fmpq_poly, G: fmpq_poly) -> CircleProduct:
        """Sum ``s_d e^(i d phi)`` over the lags d of the coefficients.

        ``cos(d phi)`` and ``sin(d phi) / sin(phi)`` are Chebyshev polynomials of the first and second kind of c.
        """
        degree = max(F.degree(), G.degree())
        reversed_g = fmpq_poly([G[degree - k] for k in range(degree + 1)])
        product = F * reversed_g
        real, imaginary = fmpq_poly([product[degree]]), fmpq_poly([0])
        for lag in range(1, degree + 1):
            ahead, behind = product[degree + lag], product[degree - lag]
            real += (ahead + behind) * fmpq_poly(fmpz_poly.chebyshev_t(lag))
            imaginary += (ahead - behind) * fmpq_poly(fmpz_poly.chebyshev_u(lag - 1))
        return cls(real, imaginary)


def roots_between(polynomial: fmpq_poly) -> list[arb]:
    """Enclosures that together contain every real root in the open interval (-1, 1), multiplicities dropped.

    The enclosures come from Arb's root isolation, which certifies that each contains one root of the square-free part,
    and sets the imaginary part to zero exactly for the real roots. A root that cannot be told from an end is kept.

    Args:
        polynomial: not zero.
    """
    ends = (fmpq_poly([-1, 1]), fmpq_poly([1, 1]))
    for end in ends:
        while polynomial.degree() > 0 and (polynomial % end).is_zero():
            polynomial = polynomial // end
    isolated: list[Any] = polynomial.numer().complex_roots() if polynomial.degree() > 0 else []
    real = [root.real for root, _ in isolated if root.imag == 0]
    return [root for root in real if not (root <= -1 or root >= 1)]


def critical_values(F: fmpq_poly, G: fmpq_poly) -> list[arb]:
    """Enclosures of every real mu for which ``F + mu G`` has a root on the unit circle.

    Such a mu is ``-F/G = -Re(F conj G) / |G|^2`` at a point of the circle where ``Im(F conj G) = 0``: at z = 1, at
    z = -1, or at a root in (-1, 1) of the polynomial B of `CircleProduct`. Where G vanishes and F does not there is no
    such mu; both cannot vanish together if ``F + mu G`` is Schur for some mu.

    Args:
        F: with ``F + mu G`` Schur for some mu.
        G: not zero.

    Raises:
        ArithmeticError: Im(F conj G) vanishes on the whole circle, so that every point of it is critical.
    """
    found = [arb(-F(z) / G(z)) for z in (fmpq(1), fmpq(-1)) if G(z) != 0]
    product, square = CircleProduct.of(F, G), CircleProduct.of(G, G).real
    crossings = product.imaginary
    if crossings.is_zero():
        raise ArithmeticError("F/G is real on the whole unit circle")
    while (common := crossings.gcd(square)).degree() > 0:
        crossings = crossings // common
    with ctx.workprec(PRECISION_BITS):
        real, magnitude = arb_poly(product.real), arb_poly(square)
        found += [-real(c) / magnitude(c) for c in roots_between(crossings)]
    return found
