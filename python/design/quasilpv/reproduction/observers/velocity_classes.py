"""To which classes of nonlinearities the velocity torque of a mechanism belongs, with proved constants.

``f(theta, omega) = -N(theta, omega) omega``, seen by an observer that measures theta and estimates omega. The torque is
quadratic in omega (plus friction), so that for every theta, with the Jacobian ``J = df/domega`` affine in omega,

    f(omega) - f(omega^) = J(theta, (omega + omega^)/2) (omega - omega^)        exactly,

and the smallest constant of each class over a convex domain is a supremum over Jacobians in it, no mean value theorem
and no gap: ``|J|`` (Lipschitz), ``lambda_max(J + J')/2`` (one-sided Lipschitz), ``|J - g/2 I|^2 - g^2/4`` (quadratic
inner-boundedness with gamma_2 = g). All three are convex in omega: they are largest at a corner of the box of speeds.
There J is affine in the sines of the relative angles, and the supremum over the box of angles is bounded by branch and
bound (`largest_eigenvalue`).

Reference: Dehak 2022, Table III.3; Nugroho, Taha and Hoang (2021) for the classes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product

import numpy as np
import sympy as sp

from quasilpv.arrays import FloatArray
from quasilpv.lmi import to_rational
from quasilpv.lmi.exact import Matrix, symmetric_part
from quasilpv.reproduction.observers.eigenvalue_bounds import (
    Bound,
    TrigonometricPencil,
    largest_eigenvalue,
    prove_below,
)
from quasilpv.systems.intervals.enclosure import enclose
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.mechanism import PlanarMechanism


@dataclass(frozen=True, eq=False)
class VelocityClasses:
    """The velocity torque of one mechanism over one operating domain.

    Attributes:
        mechanism: its dynamics.
        domain: box of joint angles and speeds, which both speeds of a difference lie in.
        tolerance: relative excess of the proved constants over the largest value found.
    """

    mechanism: PlanarMechanism
    domain: OperatingDomain
    tolerance: float = 5e-3

    def jacobian(self, theta: FloatArray, omega: FloatArray) -> FloatArray:
        """J, n x n, N m s/rad, in doubles."""
        S, alpha = self.mechanism.absolute_map, self.mechanism.absolute(theta)
        W = self.mechanism.absolute(omega)
        slope = -2.0 * self.mechanism.inertia_constants * np.sin(alpha[:, None] - alpha[None, :]) * W[None, :]
        return np.asarray(S.T @ slope @ S - np.diag(self.mechanism.friction_nm_s))

    @cached_property
    def jacobian_bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounded Jacobian: lower and upper bounds of every entry of J, proved by interval arithmetic, (n, n) each."""
        model = self.mechanism.symbolic
        torque = -model.coriolis * sp.Matrix(model.omega)
        intervals = zip(model.theta + model.omega, self.domain.angle_rad + self.domain.speed_rad_s, strict=True)
        box = dict(intervals)
        found = [enclose(entry, box, tolerance=1e-4) for entry in torque.jacobian(list(model.omega))]
        bounds = np.array(found).reshape(self.mechanism.joints, self.mechanism.joints, 2)
        return bounds[..., 0], bounds[..., 1]

    @cached_property
    def lipschitz(self) -> Bound:
        """gamma with ``|f(omega) - f(omega^)| <= gamma |omega - omega^|``, N m s/rad."""
        return self._worst(_norm_form)

    @cached_property
    def one_sided(self) -> Bound:
        """gamma with ``<f(omega) - f(omega^), omega - omega^> <= gamma |omega - omega^|^2``, N m s/rad."""
        return self._worst(_symmetric_form)

    def inner_bounded(self, gamma_2: float) -> Bound:
        """gamma_1 with ``|f - f^|^2 <= gamma_1 |omega - omega^|^2 + gamma_2 <f - f^, omega - omega^>``.

        For a frictionless mechanism and symmetric speeds the set of J is that of -J, and ``gamma_1(gamma_2)`` is even
        and convex: gamma_2 = 0, which is the Lipschitz class, gives the smallest gamma_1.
        """
        shift = Fraction(gamma_2) / 2
        root = self._worst(lambda J: _norm_form(J - shift * np.eye(len(J), dtype=int).astype(object)))
        below = float(shift) ** 2
        return Bound(
            float(np.nextafter(root.proved**2 * (1 + 1e-15) - below, np.inf)), root.attained**2 - below, root.cells
        )

    @cached_property
    def bounded(self) -> Bound:
        """lambda with ``|f|^2 <= lambda^2 |omega|^2``: without friction ``f = J omega / 2``, so half of `lipschitz`.

        What is attained is sampled on the speeds of largest norm in their direction.
        """
        generator = np.random.default_rng(0)
        angle, speed = (np.array(box).T for box in (self.domain.angle_rad, self.domain.speed_rad_s))
        ratios = []
        for _ in range(4000):
            direction = generator.normal(size=self.mechanism.joints)
            largest = direction * min(1.0 / np.max(direction / np.where(direction > 0, speed[1], speed[0])), 1e9)
            theta = generator.uniform(*angle)
            torque = self.mechanism.coriolis(theta, largest)
            ratios.append(float(np.linalg.norm(torque) / np.linalg.norm(largest)))
        friction = Fraction(max(self.mechanism.friction_nm_s)) / 2
        return Bound(self.lipschitz.proved / 2 + float(friction), max(ratios), self.lipschitz.cells)

    @cached_property
    def energy(self) -> Bound:
        """Lipschitz in the norm of the kinetic energy, for the acceleration ``a = M^-1 f``, 1/s.

        gamma with ``|a - a^|_M <= gamma |omega - omega^|_M``, ``|v|_M^2 = v'M(theta) v``: ``[M, J'/gamma; ., M] > 0``.
        """
        attained = max(self._energy_ratio(corner.astype(float)) for corner in self._corners())
        proved = attained * (1.0 + self.tolerance)
        S, D = to_rational(self.mechanism.absolute_map), to_rational(self.mechanism.inertia_constants)
        mass = [self._one_pair(k, j, D[k, j], D[k, j]) for k, j in self._pairs]
        cells = 0
        for omega in self._corners():
            constant, terms = self._terms(omega)
            fixed = _norm_form(constant / Fraction(proved)) - _twice(S.T @ np.diag(np.diag(D)) @ S)
            slopes = [_norm_form(term / Fraction(proved)) for term in terms]
            pencil = TrigonometricPencil(fixed, slopes, self._sums, [-_twice(X) for X in mass])
            cells += prove_below(pencil, 0.0, self.domain.angle_rad)
        return Bound(proved, attained, cells)

    def _energy_ratio(self, omega: FloatArray) -> float:
        """Largest ``|L^-1 J L^-T|``, ``M = L L'``, over a grid of angles."""
        grid = np.meshgrid(*(np.linspace(*interval, 15) for interval in self.domain.angle_rad), indexing="ij")
        largest = 0.0
        for theta in np.stack(grid, axis=-1).reshape(-1, self.mechanism.joints):
            factor = np.linalg.cholesky(self.mechanism.inertia(theta))
            half = np.linalg.solve(factor, self.jacobian(theta, omega))
            largest = max(largest, float(np.linalg.norm(np.linalg.solve(factor, half.T), 2)))
        return largest

    # ---- as pencils ------------------------------------------------------------------------------------------------

    @cached_property
    def _pairs(self) -> list[tuple[int, int]]:
        n = self.mechanism.joints
        return [(k, j) for k in range(n) for j in range(k + 1, n)]

    @cached_property
    def _sums(self) -> FloatArray:
        """Rows: which joint angles add up to ``alpha_j - alpha_k``, (pairs, n)."""
        S = self.mechanism.absolute_map
        return np.array([S[j] - S[k] for k, j in self._pairs])

    def _terms(self, omega: Matrix) -> tuple[Matrix, list[Matrix]]:
        """J = J_0 + sum over pairs of ``sin(alpha_j - alpha_k) J_kj``, exact.

        In absolute angles f has rows ``-sum_l D_kl sin(alpha_k - alpha_l) W_l^2``; what a factorisation of N moves
        between columns does not change N omega.
        """
        S, D = to_rational(self.mechanism.absolute_map), to_rational(self.mechanism.inertia_constants)
        W = S @ omega
        terms = [self._one_pair(k, j, 2 * D[k, j] * W[j], -2 * D[k, j] * W[k]) for k, j in self._pairs]
        return -to_rational(np.diag(self.mechanism.friction_nm_s)), terms

    def _one_pair(self, k: int, j: int, upper: Fraction, lower: Fraction) -> Matrix:
        """In joint angles, the matrix that in absolute angles has two entries: (k, j) and (j, k)."""
        S = to_rational(self.mechanism.absolute_map)
        entries = 0 * S
        entries[k, j], entries[j, k] = upper, lower
        return np.asarray(S.T @ entries @ S)

    def _corners(self) -> Iterator[Matrix]:
        for corner in product(*self.domain.speed_rad_s):
            yield to_rational(corner)

    def _worst(self, form: Callable[[Matrix], Matrix]) -> Bound:
        """The largest eigenvalue of a symmetric matrix that is affine in J, over angles and corners of speeds."""
        pencils = []
        for omega in self._corners():
            constant, terms = self._terms(omega)
            origin = form(0 * constant)
            slopes = [form(term) - origin for term in terms]
            pencils.append(TrigonometricPencil(form(constant), slopes, self._sums))
        return largest_eigenvalue(pencils, self.domain.angle_rad, self.tolerance)


def _symmetric_form(J: Matrix) -> Matrix:
    """Its largest eigenvalue is that of ``(J + J')/2``."""
    return symmetric_part(J)


def _norm_form(J: Matrix) -> Matrix:
    """``[0 J'; J 0]``: its largest eigenvalue is the largest singular value of J."""
    return np.block([[0 * J, J.T], [J, 0 * J]])


def _twice(M: Matrix) -> Matrix:
    """``diag(M, M)``."""
    return np.block([[M, 0 * M], [0 * M, M]])
