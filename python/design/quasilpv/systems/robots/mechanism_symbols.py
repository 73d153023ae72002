"""A planar mechanism in symbols: the same closed form as `dynamics`, its premises and its descriptor model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.dynamics import PlanarDynamics


@dataclass(frozen=True)
class SymbolicMechanism:
    """``M theta'' + N omega + G = Gamma`` as sympy matrices.

    Attributes:
        theta: the n joint angles (rad), symbols ``theta_1`` ... ``theta_n``.
        omega: the n joint speeds (rad/s), symbols ``omega_1`` ... ``omega_n``.
        inertia: M(theta), n x n, kg m^2.
        coriolis: N(theta, omega), n x n, friction included, in the mechanism's factorisation.
        gravity: G(theta), n x 1, N m.
        stiffness: H(theta), n x n, with G = H theta, N m.
        cosines: ``cos(alpha_l - alpha_k)`` in the order of `PlanarMechanism.inertia_premises`.
        velocity_premises: the scalar functions of (theta, omega) in which N is affine.
        stiffness_premises: the scalar functions of theta in which H is affine.
    """

    theta: tuple[sp.Symbol, ...]
    omega: tuple[sp.Symbol, ...]
    inertia: sp.Matrix
    coriolis: sp.Matrix
    gravity: sp.Matrix
    stiffness: sp.Matrix
    cosines: tuple[sp.Expr, ...]
    velocity_premises: tuple[sp.Expr, ...]
    stiffness_premises: tuple[sp.Expr, ...]

    @classmethod
    def of(cls, mechanism: PlanarDynamics) -> SymbolicMechanism:
        """Write the closed form of a mechanism."""
        n = mechanism.joints
        theta = sp.symbols(f"theta_1:{n + 1}", real=True)
        omega = sp.symbols(f"omega_1:{n + 1}", real=True)
        S = sp.Matrix(n, n, mechanism.absolute_map.astype(int).ravel().tolist())
        alpha, W = list(S * sp.Matrix(theta)), list(S * sp.Matrix(omega))
        D = mechanism.inertia_constants
        gravity = [sp.Float(mechanism.equilibrium_sign * g) for g in mechanism.gravity_constants]

        inertia = S.T * sp.Matrix(n, n, lambda k, j: sp.Float(D[k, j]) * sp.cos(alpha[k] - alpha[j])) * S
        coriolis = S.T * sp.Matrix(n, n, lambda k, j: sp.Float(D[k, j]) * sp.sin(alpha[k] - alpha[j]) * W[j]) * S
        coriolis += sp.diag(*(sp.Float(f) for f in mechanism.friction_nm_s))
        sinc_terms = sp.diag(*(g * sp.sinc(a) for g, a in zip(gravity, alpha, strict=True)))
        return cls(
            theta,
            omega,
            inertia.applyfunc(sp.expand),
            coriolis.applyfunc(sp.expand),
            S.T * sp.Matrix([g * sp.sin(a) for g, a in zip(gravity, alpha, strict=True)]),
            (S.T * sinc_terms * S).applyfunc(sp.expand),
            tuple(sp.cos(alpha[j] - alpha[k]) for k, j in _pairs(n)),
            tuple(W[link] * sp.sin(alpha[j] - alpha[k]) for k, j in _pairs(n) for link in (k, j)),
            tuple(sp.sinc(angle) for angle in alpha) if mechanism.gravity_constants.any() else (),
        )

    def inertia_premises(self, domain: OperatingDomain) -> tuple[Premise, ...]:
        """See `PlanarMechanism.inertia_premises`."""
        return self._over(domain, self.cosines, first=1, kind=PremiseKind.MEASURED)

    def premises(self, domain: OperatingDomain) -> tuple[Premise, ...]:
        """All premises of the descriptor model, in the order of Example I.2 for n = 2, of Table I.3 otherwise."""
        premises = self.inertia_premises(domain)
        groups = [
            (self.velocity_premises, PremiseKind.ESTIMATED),
            (self.stiffness_premises, PremiseKind.MEASURED),
        ]
        for expressions, kind in reversed(groups) if len(self.theta) == 2 else groups:
            premises += self._over(domain, expressions, first=len(premises) + 1, kind=kind)
        return premises

    def descriptor_system(self, name: str, domain: OperatingDomain) -> DescriptorSystem:
        """See `PlanarMechanism.as_descriptor_system`."""
        n = len(self.theta)
        identity, zero = sp.eye(n), sp.zeros(n, n)
        return DescriptorSystem.from_symbols(
            name=name,
            state=self.theta + self.omega,
            inputs=tuple(f"torque_{joint}" for joint in range(1, n + 1)),
            E=sp.diag(identity, self.inertia),
            A=sp.Matrix(sp.BlockMatrix([[zero, identity], [-self.stiffness, -self.coriolis]])),
            B=sp.Matrix.vstack(zero, identity),
            C=sp.Matrix.hstack(identity, zero),
            premises=self.premises(domain),
            domain=self._box(domain),
        )

    def _box(self, domain: OperatingDomain) -> dict[sp.Symbol, tuple[float, float]]:
        if domain.joints != len(self.theta):
            raise InputError("domain", "joints", domain.joints, str(len(self.theta)))
        intervals = domain.angle_rad + domain.speed_rad_s
        return dict(zip(self.theta + self.omega, intervals, strict=True))

    def _over(
        self, domain: OperatingDomain, expressions: Iterable[sp.Expr], first: int, kind: PremiseKind
    ) -> tuple[Premise, ...]:
        box = self._box(domain)
        return tuple(
            Premise.over(box, f"z{index}", expression, kind) for index, expression in enumerate(expressions, first)
        )


def _pairs(n: int) -> list[tuple[int, int]]:
    """All k < l, neighbours first."""
    return [(k, k + gap) for gap in range(1, n) for k in range(n - gap)]
