"""Planar arms with the matrix N of the source instead of the skew one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from quasilpv.arrays import Matrix
from quasilpv.errors import InputError
from quasilpv.systems.robots.arms import PlanarSerialArm
from quasilpv.systems.robots.mechanism_symbols import SymbolicMechanism


@dataclass(frozen=True)
class PrintedSerialArm(PlanarSerialArm):
    """An arm of 2 or 3 joints whose N is that of Dehak 2022, Examples I.2 and I.4, with their signs corrected.

    ``N = N_skew + shift D_12 sin(theta_2) e_1 [omega_2, -omega_1, 0 ...]`` with shift -1 for 2 joints and +1 for 3: the
    source moves the term omega_1 omega_2 of the first row from one column to the other, which leaves N omega as it is.
    Of dM/dt - 2 N only omega^T (dM/dt - 2 N) omega = 0 holds. Premises are those of Example I.2 and Table I.3.

    Raises:
        InputError: another number of joints, or an arm that is none.
    """

    def __post_init__(self) -> None:
        """Refuse arms that the source has no matrices for."""
        super().__post_init__()
        if self.joints not in (2, 3):
            raise InputError(self.name, "joints", self.joints, "2 or 3, the arms of the source")

    @property
    def skew(self) -> PlanarSerialArm:
        """The same arm with the skew N."""
        return PlanarSerialArm(self.name, self.links, self.gravity_m_s2, self.equilibrium)

    @property
    def _shift(self) -> float:
        return {2: -1.0, 3: +1.0}[self.joints]

    def coriolis_matrix(self, theta: ArrayLike, omega: ArrayLike) -> Matrix:
        """Matrix N(theta, omega), n x n, friction included."""
        N = super().coriolis_matrix(theta, omega)
        alpha, W = self.absolute(theta), self.absolute(omega)
        shift = self._shift * self.inertia_constants[0, 1] * np.sin(alpha[1] - alpha[0])
        N[0, 0] += shift * (W[1] - W[0])
        N[0, 1] -= shift * W[0]
        return N

    @cached_property
    def symbolic(self) -> SymbolicMechanism:
        """The same model as sympy expressions, with the premises of the source."""
        skew = SymbolicMechanism.of(self)
        theta, omega, coriolis = skew.theta, skew.omega, skew.coriolis.copy()
        shift = sp.Float(self._shift * self.inertia_constants[0, 1]) * sp.sin(theta[1])
        coriolis[0, 0] += shift * omega[1]
        coriolis[0, 1] -= shift * omega[0]
        return replace(
            skew,
            coriolis=coriolis.applyfunc(sp.expand),
            velocity_premises=self._velocity_premises(theta, omega),
            stiffness_premises=self._stiffness_premises(skew),
        )

    def _velocity_premises(self, theta: tuple[sp.Symbol, ...], omega: tuple[sp.Symbol, ...]) -> tuple[sp.Expr, ...]:
        sin = sp.sin
        if self.joints == 2:
            c2 = sp.Float(self.inertia_constants[0, 1])
            return (c2 * omega[1] * sin(theta[1]), -c2 * omega[0] * sin(theta[1]))
        (_, t2, t3), (w1, w2, w3) = theta, omega
        tool = w1 + w2 + w3
        return (
            (2 * w1 + w2) * sin(t2),
            w1 * sin(t2),
            w1 * sin(t2 + t3),
            (w1 + w2) * sin(t3),
            tool * sin(t3),
            tool * sin(t2 + t3),
        )

    def _stiffness_premises(self, skew: SymbolicMechanism) -> tuple[sp.Expr, ...]:
        sincs = skew.stiffness_premises
        if self.joints == 3 or not sincs:
            return sincs
        gravity = [sp.Float(self.equilibrium_sign * g) for g in self.gravity_constants]
        return (-gravity[0] * sincs[0] - gravity[1] * sincs[1], -gravity[1] * sincs[1])
