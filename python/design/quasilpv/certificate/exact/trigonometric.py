"""Polynomials in angles, speeds and their sines, cosines and sinc, with exact rational coefficients.

What equations of motion and the premises of a law are made of. Two such expressions are equal as functions if their
difference is the zero polynomial here; if it is not, rounding of the numbers they were written with for example, the
difference is bounded over a box by the sum of its coefficients: sines, cosines and sinc are at most 1.

Products of sines and cosines of whole combinations of the angles are written as exponentials
``exp(i (k_1 theta_1 + ... + k_n theta_n))`` with complex rational coefficients; ``sinc(a)`` is a symbol of its own, in
which ``a sinc(a) = sin a`` is used to remove its first angle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from flint import fmpq

from quasilpv.certificate.exact.matrices import rational

Whole: TypeAlias = tuple[int, ...]
Complex: TypeAlias = tuple[fmpq, fmpq]
Number: TypeAlias = "int | float | fmpq"

NONE: Complex = (fmpq(0), fmpq(0))


class UnsupportedError(ValueError):
    """An expression that is no polynomial of this kind, e.g. the sine of a product of angles."""


class Monomial(NamedTuple):
    """``theta^a omega^b exp(i k theta) sinc(c_1 theta) sinc(c_2 theta) ...``.

    Attributes:
        powers: a and b, 2 n exponents.
        phase: k, n whole numbers.
        sincs: the c, sorted, the first number of each that is not zero positive.
    """

    powers: Whole
    phase: Whole
    sincs: tuple[Whole, ...]


@dataclass(frozen=True, eq=False)
class Polynomial:
    """One expression; it adds, subtracts, multiplies with its like and with numbers.

    Attributes:
        joints: n.
        terms: complex coefficient of every monomial.
    """

    joints: int
    terms: Mapping[Monomial, Complex]

    @classmethod
    def number(cls, joints: int, value: Number) -> Polynomial:
        """A constant."""
        exact = value if isinstance(value, fmpq) else rational(value)
        return cls(joints, {Monomial((0,) * (2 * joints), (0,) * joints, ()): (exact, fmpq(0))} if exact != 0 else {})

    @classmethod
    def variables(cls, joints: int) -> tuple[list[Polynomial], list[Polynomial]]:
        """The angles, and the speeds."""
        found = []
        for k in range(2 * joints):
            powers = tuple(int(k == j) for j in range(2 * joints))
            found.append(cls(joints, {Monomial(powers, (0,) * joints, ()): (fmpq(1), fmpq(0))}))
        return found[:joints], found[joints:]

    def __add__(self, other: Polynomial | Number) -> Polynomial:
        """Sum."""
        return _collected(self.joints, [*self.terms.items(), *self._like(other).terms.items()])

    def __mul__(self, other: Polynomial | Number) -> Polynomial:
        """Product."""
        products = [
            (_product(one, two), _times(a, b))
            for one, a in self.terms.items()
            for two, b in self._like(other).terms.items()
        ]
        return _reduced(self.joints, products)

    def __neg__(self) -> Polynomial:
        """Negative."""
        return self * -1

    def __sub__(self, other: Polynomial | Number) -> Polynomial:
        """Difference."""
        return self + -self._like(other)

    def __truediv__(self, other: Polynomial | Number) -> Polynomial:
        """Quotient by a number; UnsupportedError of anything else, or zero."""
        divisor = self._like(other)
        constant = Polynomial.number(self.joints, 1).terms.keys()
        if divisor.terms.keys() != constant:
            raise UnsupportedError("a quotient by something that is not a number")
        ((value, _),) = divisor.terms.values()
        return self * (1 / value)

    def __radd__(self, other: Number) -> Polynomial:
        """Sum."""
        return self + other

    def __rmul__(self, other: Number) -> Polynomial:
        """Product."""
        return self * other

    def __rsub__(self, other: Number) -> Polynomial:
        """Difference."""
        return -self + other

    def __pow__(self, exponent: int) -> Polynomial:
        """Power with a whole exponent >= 0."""
        if exponent < 0:
            raise UnsupportedError("a negative power")
        result = Polynomial.number(self.joints, 1)
        for _ in range(exponent):
            result = result * self
        return result

    def sin(self) -> Polynomial:
        """Sine of a whole combination of the angles; UnsupportedError of anything else."""
        return _waves(self._angle(), fmpq(0), fmpq(-1, 2))

    def cos(self) -> Polynomial:
        """Cosine, as `sin`."""
        return _waves(self._angle(), fmpq(1, 2), fmpq(0))

    def sinc(self) -> Polynomial:
        """``sin(a) / a``, as `sin`."""
        angle = self._angle()
        first = next((k for k in angle if k), 0)
        if not first:
            return Polynomial.number(self.joints, 1)
        positive = angle if first > 0 else tuple(-k for k in angle)
        zeros = (0,) * self.joints
        return Polynomial(self.joints, {Monomial(zeros * 2, zeros, (positive,)): (fmpq(1), fmpq(0))})

    def bound(self, largest: Sequence[fmpq]) -> fmpq:
        """Bound of the absolute value where every angle and speed is at most so large; 0 of the zero polynomial.

        Args:
            largest: 2 n bounds of angles and speeds.
        """
        total = fmpq(0)
        for monomial, (real, imaginary) in self.terms.items():
            size = abs(real) + abs(imaginary)
            for bound, power in zip(largest, monomial.powers, strict=True):
                size *= bound**power
            total += size
        return total

    def _angle(self) -> Whole:
        combination = [0] * self.joints
        for monomial, (real, imaginary) in self.terms.items():
            powers = monomial.powers
            is_angle = sum(powers) == sum(powers[: self.joints]) == 1 and not any(monomial.phase)
            if not is_angle or monomial.sincs or imaginary != 0 or real.q != 1:
                raise UnsupportedError("a function of something else than a whole combination of the angles")
            combination[powers.index(1)] = int(real.p)
        return tuple(combination)

    def _like(self, other: Polynomial | Number) -> Polynomial:
        return other if isinstance(other, Polynomial) else Polynomial.number(self.joints, other)


def _waves(angle: Whole, real: fmpq, imaginary: fmpq) -> Polynomial:
    """``c exp(i a) + conj(c) exp(-i a)``."""
    n = len(angle)
    ends = ((angle, (real, imaginary)), (tuple(-k for k in angle), (real, -imaginary)))
    return _collected(n, [(Monomial((0,) * (2 * n), phase, ()), coefficient) for phase, coefficient in ends])


def _product(one: Monomial, two: Monomial) -> Monomial:
    powers, phase = (
        tuple(a + b for a, b in zip(p, q, strict=True)) for p, q in ((one.powers, two.powers), (one.phase, two.phase))
    )
    return Monomial(powers, phase, tuple(sorted((*one.sincs, *two.sincs))))


def _times(one: Complex, two: Complex) -> Complex:
    return one[0] * two[0] - one[1] * two[1], one[0] * two[1] + one[1] * two[0]


def _collected(joints: int, terms: Iterable[tuple[Monomial, Complex]]) -> Polynomial:
    total: dict[Monomial, Complex] = {}
    for monomial, (real, imaginary) in terms:
        before = total.get(monomial, NONE)
        total[monomial] = before[0] + real, before[1] + imaginary
    return Polynomial(joints, {m: c for m, c in total.items() if c != NONE})


def _reduced(joints: int, terms: list[tuple[Monomial, Complex]]) -> Polynomial:
    """Every ``theta_l sinc(a)``, l the first angle of a, replaced; terms of one monomial added.

    By ``(sin a - sum_(j > l) a_j theta_j sinc(a)) / a_l``. Every step removes a sinc or moves a power to a later angle,
    so that there is an end.
    """
    done: list[tuple[Monomial, Complex]] = []
    pending = list(terms)
    while pending:
        monomial, coefficient = pending.pop()
        found = next(
            ((a, first) for a in monomial.sincs if monomial.powers[first := next(j for j, k in enumerate(a) if k)]),
            None,
        )
        if found is None:
            done.append((monomial, coefficient))
            continue
        angle, first = found
        scaled = _times(coefficient, (fmpq(1, angle[first]), fmpq(0)))
        fewer = _moved(monomial.powers, first, None)
        sincs = list(monomial.sincs)
        sincs.remove(angle)
        for sign in (1, -1):  # sin a = (exp(i a) - exp(-i a)) / (2 i)
            phase = tuple(p + sign * k for p, k in zip(monomial.phase, angle, strict=True))
            pending.append((Monomial(fewer, phase, tuple(sincs)), _times(scaled, (fmpq(0), fmpq(-sign, 2)))))
        for j, factor in enumerate(angle):
            if factor and j != first:
                moved = monomial._replace(powers=_moved(monomial.powers, first, j))
                pending.append((moved, _times(scaled, (fmpq(-factor), fmpq(0)))))
    return _collected(joints, done)


def _moved(powers: Whole, source: int, target: int | None) -> Whole:
    return tuple(power - (k == source) + (k == target) for k, power in enumerate(powers))
