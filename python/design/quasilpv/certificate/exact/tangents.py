"""Values with their derivatives along some directions: what programs are run on where a slope is to be enclosed.

``(f, [D_1 f, ...])`` with the rules of differentiation, over balls: an enclosure of f and of its derivatives over a
cell. No second program is needed, and none is trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flint import arb

from quasilpv.certificate.exact.trigonometric import UnsupportedError


def power(x: arb, exponent: int) -> arb:
    """``x^n``: the exact range, of even powers too; ``**`` of a ball around 0 is not a number."""
    if exponent < 0:
        return 1 / power(x, -exponent)
    if exponent == 0:
        return arb(1)
    low, high = (x.abs_lower(), x.abs_upper()) if exponent % 2 == 0 else (x.lower(), x.upper())
    return (low**exponent).union(high**exponent)


@dataclass(frozen=True)
class Tangent:
    """A value and its derivatives; none of them stands for derivatives that are all zero."""

    value: arb
    slopes: tuple[arb, ...] = ()

    def _along(self, slope: arb, value: arb) -> Tangent:
        return Tangent(value, tuple(slope * own for own in self.slopes))

    def __add__(self, other: Tangent | float) -> Tangent:
        """The sum."""
        if not isinstance(other, Tangent):
            return Tangent(self.value + other, self.slopes)
        return Tangent(self.value + other.value, _sum(self.slopes, other.slopes))

    def __neg__(self) -> Tangent:
        """The negative."""
        return Tangent(-self.value, tuple(-own for own in self.slopes))

    def __sub__(self, other: Tangent) -> Tangent:
        """The difference."""
        return self + (-other)

    def __mul__(self, other: Tangent) -> Tangent:
        """The product."""
        left = tuple(other.value * own for own in self.slopes)
        return Tangent(self.value * other.value, _sum(left, tuple(self.value * own for own in other.slopes)))

    def __rmul__(self, other: float) -> Tangent:
        """A number times it."""
        return Tangent(arb(0)) if other == 0 else self._along(arb(other), other * self.value)

    def __truediv__(self, other: Tangent) -> Tangent:
        """The quotient."""
        value = self.value / other.value
        scaled = tuple(-value * own for own in other.slopes)
        return Tangent(value, tuple(own / other.value for own in _sum(self.slopes, scaled)))

    def __pow__(self, exponent: int) -> Tangent:
        """An integer power."""
        return self._along(exponent * power(self.value, exponent - 1), power(self.value, exponent))

    def sin(self) -> Tangent:
        """The sine."""
        return self._along(self.value.cos(), self.value.sin())

    def cos(self) -> Tangent:
        """The cosine."""
        return self._along(-self.value.sin(), self.value.cos())

    def exp(self) -> Tangent:
        """The exponential."""
        return self._along(self.value.exp(), self.value.exp())

    def sqrt(self) -> Tangent:
        """The square root."""
        root = self.value.sqrt()
        return self._along(1 / (2 * root), root)

    def log(self) -> Tangent:
        """The natural logarithm."""
        return self._along(1 / self.value, self.value.log())

    def tanh(self) -> Tangent:
        """The hyperbolic tangent."""
        value = self.value.tanh()
        return self._along(1 - value * value, value)

    def __abs__(self) -> Tangent:
        """Refused: it has no slope at 0."""
        raise UnsupportedError("the slope of abs")


def _sum(left: Sequence[arb], right: Sequence[arb]) -> tuple[arb, ...]:
    if not left or not right:
        return tuple(left or right)
    return tuple(a + b for a, b in zip(left, right, strict=True))
