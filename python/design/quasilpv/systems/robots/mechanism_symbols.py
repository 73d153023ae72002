"""A planar mechanism in symbols: the same closed form as `mechanism`, its premises and its descriptor model."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.robots.arm_parameters import OperatingDomain

if TYPE_CHECKING:
    from quasilpv.systems.robots.mechanism import PlanarMechanism


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
    def of(cls, mechanism: PlanarMechanism) -> SymbolicMechanism:
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
        if mechanism.printed_coriolis_shift:
            shift = sp.Float(mechanism.printed_coriolis_shift * D[0, 1]) * sp.sin(theta[1])
            coriolis[0, 0] += shift * omega[1]
            coriolis[0, 1] -= shift * omega[0]
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
            _velocity_premises(mechanism, theta, omega, alpha, W),
            _stiffness_premises(mechanism, alpha, gravity),
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


def _velocity_premises(
    mechanism: PlanarMechanism,
    theta: tuple[sp.Symbol, ...],
    omega: tuple[sp.Symbol, ...],
    alpha: list[sp.Expr],
    W: list[sp.Expr],
) -> tuple[sp.Expr, ...]:
    sin = sp.sin
    if mechanism.printed_coriolis_shift and mechanism.joints == 2:
        c2 = sp.Float(mechanism.inertia_constants[0, 1])
        return (c2 * omega[1] * sin(theta[1]), -c2 * omega[0] * sin(theta[1]))
    if mechanism.printed_coriolis_shift:
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
    return tuple(W[link] * sin(alpha[j] - alpha[k]) for k, j in _pairs(mechanism.joints) for link in (k, j))


def _stiffness_premises(
    mechanism: PlanarMechanism, alpha: list[sp.Expr], gravity: list[sp.Expr]
) -> tuple[sp.Expr, ...]:
    if not mechanism.gravity_constants.any():
        return ()
    sincs = [sp.sinc(angle) for angle in alpha]
    if mechanism.printed_coriolis_shift and mechanism.joints == 2:
        return (-gravity[0] * sincs[0] - gravity[1] * sincs[1], -gravity[1] * sincs[1])
    return tuple(sincs)
