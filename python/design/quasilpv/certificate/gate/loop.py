"""The characteristic polynomial of the frozen sampled loop of the acceleration-level law, in exact arithmetic.

The law (``docs/concepts/acceleration-law.md``) with zero reference against the plant ``theta'' = mu a``, its command
held over a sample and late by a transport delay of ``w + f`` samples (w whole, 0 <= f < 1). Time is counted in samples
(T = 1), ``zeta = z - 1``. With the estimate e, the innovation nu and the measured angle y the law reads

    zeta e4 = z l4 nu                              y  = e1 + (1 - l1) nu
    zeta e3 = z l3 nu + e4                         df = (1 - q) z e3 / (z - q)
    zeta e2 = z l2 nu + e3 + e4/2 + a              eI = y / zeta
    zeta e1 = z l1 nu + e2 + e3/2 + e4/6 + a/2     a  = -df + kp e1 + kd e2 + ki eI

Solved from e4 up to e1, then for nu and a, this is the controller ``a = N_c/D_c y`` with six poles. The exact
zero-order-hold plant is ``y = mu N_p / (z^(w+1) zeta^2) a`` with ``g = 1 - f`` and

    N_p = 1 + (g + 1/2) zeta + g^2/2 zeta^2.

Where the drives lag, ``s acc' = a - acc`` with ``theta'' = mu acc`` and s in samples, N_p becomes, with ``u = g - s``,

    N = 1 + (u + 1/2) zeta + (u^2 + s^2)/2 zeta^2 - s^2 exp(-g/s) zeta^3 / (zeta + 1 - exp(-1/s)),

by partial fractions of ``1/(p^2 (1 + s p))``. Its exponentials are not rational: they are balls of Arb arithmetic.

Written from the formulas of the law and of the plant, not from the design's own loop: the two are compared by tests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flint import arb, arb_poly, ctx, fmpq, fmpq_poly

from quasilpv.certificate.exact.matrices import rational
from quasilpv.certificate.exact.polynomials import is_schur_enclosed
from quasilpv.errors import InputError

ONE = fmpq_poly([1])
ZETA = fmpq_poly([0, 1])
Z = ONE + ZETA
FORGETTING_BITS = 256
LAGGING_BITS = 512

Interval = tuple[fmpq, fmpq]
"""Of delays or lags, in samples."""

NO_LAG: Interval = (fmpq(0), fmpq(0))


@dataclass(frozen=True)
class AccelerationLoopData:
    """The numbers of the law `dob-acceleration` that decide its frozen loop, as shipped.

    Attributes:
        sample_period_s: T > 0.
        kp: feedback of the angle error x - x_r, 1/s^2.
        kd: feedback of the speed error, 1/s.
        ki: feedback of the integral of the angle error, 1/s^3.
        observer: (l1, l2, l3, l4), in 1, 1/s, 1/s^2, 1/s^3.
        filter_time_constant_s: T_f > 0 of the disturbance filter.
        disturbance_compensation: whether the filtered disturbance is fed back.

    Raises:
        InputError: a number is not finite, or a time is not positive.
    """

    sample_period_s: float
    kp: float
    kd: float
    ki: float
    observer: tuple[float, float, float, float]
    filter_time_constant_s: float
    disturbance_compensation: bool = True

    def __post_init__(self) -> None:
        """Refuse what is not a law."""
        for field in ("sample_period_s", "filter_time_constant_s"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value > 0):
                raise InputError("law", field, value, "a finite number > 0")
        for field, value in (("kp", self.kp), ("kd", self.kd), ("ki", self.ki)):
            if not math.isfinite(value):
                raise InputError("law", field, value, "a finite number")
        if not all(map(math.isfinite, self.observer)):
            raise InputError("law", "observer", self.observer, "finite numbers")

    def filter_poles(self) -> tuple[fmpq, fmpq]:
        """The two doubles on either side of ``exp(-T/T_f)``, as rationals.

        The run-time computes its filter pole with the exponential of its C library, from the double quotient -T/T_f.
        Any library that errs by less than one unit in the last place returns one of these two numbers, and what is
        proved is proved for both.
        """
        return exponential_poles(-self.sample_period_s / self.filter_time_constant_s)


def exponential_poles(exponent: float) -> tuple[fmpq, fmpq]:
    """The two doubles on either side of the exponential of a double, as rationals."""
    with ctx.workprec(FORGETTING_BITS):
        pole = arb(exponent).exp()
        below = math.exp(exponent)
        while not arb(below) < pole:
            below = math.nextafter(below, -math.inf)
        while arb(math.nextafter(below, math.inf)) < pole:
            below = math.nextafter(below, math.inf)
    return rational(below), rational(math.nextafter(below, math.inf))


@dataclass(frozen=True)
class Controller:
    """``a = N_c/D_c y`` as polynomials in zeta: D_c monic of degree 6 (5 without integral action), N_c of no more."""

    numerator: fmpq_poly
    denominator: fmpq_poly

    @classmethod
    def of(cls, data: AccelerationLoopData, filter_pole: fmpq) -> Controller:
        """Eliminate the estimate, the innovation and the filter (see the module) for one filter pole q.

        ``e_i = (E_i nu + H_i a) / zeta^4``, then ``nu`` and ``a`` by Cramer's rule.
        """
        T = rational(data.sample_period_s)
        kp, kd, ki = rational(data.kp) * T**2, rational(data.kd) * T, rational(data.ki) * T**3
        l1, l2, l3, l4 = (rational(gain) * T**power for power, gain in enumerate(data.observer))
        x = ZETA
        E4 = Z * l4 * x**3
        E3 = Z * l3 * x**3 + E4 // x
        E2 = Z * l2 * x**3 + (E3 + E4 / 2) // x
        E1 = Z * l1 * x**3 + (E2 + E3 / 2 + E4 / 6) // x
        H2 = x**3
        H1 = (H2 + x**4 / 2) // x
        fed_back = (1 - filter_pole) * Z * E3 if data.disturbance_compensation else fmpq_poly([0])
        pole = Z - filter_pole
        # [angle_nu, H1; command_nu, command_a] [nu; a] = [x^4; pole ki x^3] y
        angle_nu = E1 + (1 - l1) * x**4
        command_nu = fed_back - pole * (kp * E1 + kd * E2)
        command_a = pole * (x**4 - kp * H1 - kd * H2)
        denominator = angle_nu * command_a - H1 * command_nu
        numerator = angle_nu * pole * ki * x**3 - command_nu * x**4
        # Multiplying the estimate by zeta^4 has put zeta^3 too much into both, and an integral that nothing reads one
        # zeta more.
        excess = x**3 if ki != 0 else x**4
        return cls(numerator // excess, denominator // excess)


@dataclass(frozen=True)
class CharacteristicPolynomial:
    """``p(z; mu) = F(z) + mu G(z)``, coefficients in ascending powers of z; F is monic and of larger degree than G."""

    F: fmpq_poly
    G: fmpq_poly

    @classmethod
    def of(cls, controller: Controller, delay_samples: fmpq) -> CharacteristicPolynomial:
        """``F = D_c z^(w+1) zeta^2``, ``G = -N_c N_p`` for a transport delay of w + f samples.

        Raises:
            InputError: the delay is negative.
        """
        if delay_samples < 0:
            raise InputError("loop", "delay", delay_samples, "a delay >= 0")
        whole = int(delay_samples.floor())
        early = 1 - (delay_samples - whole)
        plant = fmpq_poly([1, early + fmpq(1, 2), early**2 / 2])
        to_z = fmpq_poly([-1, 1])
        F = controller.denominator * Z ** (whole + 1) * ZETA**2
        G = -controller.numerator * plant
        return cls(F(to_z), G(to_z))


@dataclass(frozen=True)
class LaggingPolynomial:
    """The same with drives that lag: ``F + mu G``, ball coefficients in ascending powers of zeta; F is monic."""

    F: arb_poly
    G: arb_poly

    @classmethod
    def of(cls, controller: Controller, delay_samples: fmpq, lag_samples: fmpq) -> LaggingPolynomial:
        """``F = D_c z^(w+1) zeta^2 (zeta + 1 - exp(-1/s))``, ``G = -N_c N (zeta + 1 - exp(-1/s))``.

        Args:
            controller: of one filter pole.
            delay_samples: w + f >= 0.
            lag_samples: s > 0.
        """
        whole, s = int(delay_samples.floor()), lag_samples
        early = 1 - (delay_samples - whole)
        u = early - s
        with ctx.workprec(LAGGING_BITS):
            pole = arb_poly([1 - (arb(-1 / s)).exp(), 1])
            late = arb_poly([0, 0, 0, arb(s**2) * (arb(-early / s)).exp()])
            plant = arb_poly(fmpq_poly([1, u + fmpq(1, 2), (u**2 + s**2) / 2])) * pole - late
            F = arb_poly(controller.denominator * Z ** (whole + 1) * ZETA**2) * pole
            return cls(F, -arb_poly(controller.numerator) * plant)

    def is_schur(self) -> bool:
        """Whether all roots at ``mu = 1`` are proved to lie inside the unit circle; False where balls are too wide."""
        with ctx.workprec(LAGGING_BITS):
            return is_schur_enclosed((self.F + self.G)(arb_poly([-1, 1])))
