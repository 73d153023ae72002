"""Observer of a sampled regular system that is scheduled with estimated premises where they are not measured.

The premises z of a system are measured, or functions of states that are not. The observer uses what it has,

    E(z_k) (x^_k+1 - x^_k) = h (A(z_k, z^_k) x^_k + B(z_k) u_k) + L(z_k) (y_k - C x^_k),

with z measured and z^ the estimated premises at (y, x^). Of Euler's sampled model (as in `sampled_observer`) the error
obeys ``E(z) d = (A~(z) - L~(z) C) e + B p``, ``e_k+1 = e + h d``, ``L = h L~``, where ``A~ e + B p`` collects the
measured part of A and ``f(x) - f(x^)`` of the estimated part, in a class of `mismatch`. ``V = e'Q e`` contracts,
``V_k+1 < rho^2 V_k`` with ``rho = exp(-alpha h)``, if ``2 e'Q d + h d'Q d + c e'Q e < 0``, ``c = (1 - rho^2)/h``, on
that equation and the class: by Finsler's lemma with multipliers H and t H, and the S-procedure with ``tau_k > 0``, on
(e, d, p)

    sum_ij w_i w_j [c Q + He(X_ij) + sum tau_k Pi_ee, *, *;  Q - E_i'H_j + t X_ij, h Q - t He(H_j'E_i), *;
                    B'H_j + sum tau_k Pi_pe, t B'H_j, sum tau_k Pi_pp] < 0,    X_ij = H_j'A~_i - Y_j C.

It implies ``V' < -c V`` for the observer in continuous time as well: ``d'Q d >= 0``. The sampling time h bounds the
gains: the poles of the error without mismatch lie in the disk ``|1 + h s| < rho``.

The class must hold for every pair (x, x^) the observer meets: the true state and the estimate in the domain. Own
statement; Dehak 2022, III.4, names it as a perspective.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import exp

import numpy as np
import sympy as sp

from quasilpv.conditions.condition import (
    Condition,
    Feedback,
    Options,
    Statement,
    Values,
    vertex_sum,
)
from quasilpv.conditions.forms.mismatch import Form, Mismatch, bounded_jacobian
from quasilpv.conditions.gains import ObserverGain
from quasilpv.conditions.reliance import Reliance
from quasilpv.conditions.theorems.sampled_observer import MULTIPLIER_SAMPLES
from quasilpv.errors import InputError
from quasilpv.lmi import Expression, Problem, Variable, block, he, to_rational
from quasilpv.lmi.exact import Matrix
from quasilpv.polytopes import PolytopicModel
from quasilpv.systems.descriptor.premise import AffineMatrix, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.intervals.enclosure import enclose

_ID = "estimated-observer"
_TOLERANCE = 1e-4


def inequalities(model: PolytopicModel, options: Options) -> Statement:
    """State the condition with the bounded Jacobian of the estimated part, proved over the system's domain.

    Raises:
        InputError: an output matrix that depends on premises, no estimated premises, or some in E or B.
    """
    _require_supported(model)
    own = measured_part(model)
    return statement(own, [jacobian_class(model.system)] * own.vertex_count, options, measured_premises(model.system))


def statement(
    own: PolytopicModel, classes: Sequence[Mismatch], options: Options, places: Sequence[int] | None = None
) -> Statement:
    """State the condition for a class of differences.

    Unknowns ``Q = Q' > 0`` (n, n), ``tau_k > 0``, and per vertex of the measured premises H_j (n, n), Y_j (n, outputs).
    With a common H (`Options.common`) the double sum is a single one: much cheaper, and more conservative.

    Args:
        own: the system without its estimated part.
        classes: of ``f(x) - f(x^)``, one per vertex: the forms may be affine in the measured premises, the input not.
        options: as for every condition.
        places: of the premises of ``own`` in the premise vectors the observer is given; all, in order, if None.
    """
    n, count = own.order, own.vertex_count
    C = to_rational(own.system.C.constant)
    h = Fraction(options.sample_period_s)
    t = h * MULTIPLIER_SAMPLES
    rate = (1 - Fraction(exp(-2.0 * options.decay_rate * options.sample_period_s))) / h
    Q = Variable("Q", n, symmetric=True)
    H = [Variable("H", n)] * count if options.common else [Variable(f"H{j}", n) for j in range(count)]
    Y = [Variable(f"Y{j}", n, len(C)) for j in range(count)]
    taus = [Variable(f"tau{k}", 1) for k in range(len(classes[0].forms))]
    forms = [
        [_weighted(taus, [getattr(form, part) for form in one.forms]) for part in Form.__dataclass_fields__]
        for one in classes
    ]
    drive = [classes[0].input.T @ Hj for Hj in H]

    def entry(i: int, j: int) -> Expression:
        ee, pe, pp = forms[i]
        X = H[j].T @ (own.A[i] + classes[i].drift) - Y[j] @ C
        image = H[j].T @ own.E[i]
        return block(
            [
                [he(X) + Q * rate + ee, None, None],
                [Q - image.T + X * t, Q * h - he(image) * t, None],
                [drive[j] + pe, drive[j] * t, pp],
            ]
        )

    problem = Problem()
    problem.positive("Q", Q)
    for tau in taus:
        problem.positive(tau.name, tau)
    slacks = vertex_sum(problem, "Xi", entry, own, options.slack, single=options.common)

    def feedback(values: Values) -> Feedback:
        H_vertices, Y_vertices = (np.stack([values[X] for X in unknowns]) for unknowns in (H, Y))
        kept = None if places is None else tuple(places)
        observer = ObserverGain(own.polytope, H_vertices, Y_vertices, options.sample_period_s, kept)
        return Feedback(np.asarray(np.linalg.inv(values[Q])), None, observer=observer)

    return Statement(problem, feedback, slacks)


def measured_premises(system: DescriptorSystem) -> tuple[int, ...]:
    """Indices of the premises an observer need not estimate."""
    return tuple(k for k, premise in enumerate(system.premises) if premise.kind is PremiseKind.MEASURED)


def measured_part(model: PolytopicModel) -> PolytopicModel:
    """The system without its estimated premises: they are 0 in it."""
    system, kept = model.system, list(measured_premises(model.system))
    E, A, B, C = (
        AffineMatrix(matrix.constant, matrix.coefficients[kept]) for matrix in (system.E, system.A, system.B, system.C)
    )
    own = replace(system, premises=tuple(system.premises[k] for k in kept), E=E, A=A, B=B, C=C)
    return PolytopicModel(own, model.polytope.restricted(kept))


def jacobian_class(system: DescriptorSystem) -> Mismatch:
    """Bounds of the derivatives of ``f(x) = sum z_p(x) A_p x`` over estimated p, by the states that are not measured.

    A state is measured if it is an output: the observer takes it from y in f, and the difference is in the others.

    Raises:
        InputError: a derivative is not bounded over the domain.
    """
    x = sp.Matrix(list(system.state))
    measured = {int(np.flatnonzero(row)[0]) for row in system.C.constant if np.count_nonzero(row) == 1}
    f = sp.zeros(system.order, 1)
    for k, premise in enumerate(system.premises):
        if premise.kind is PremiseKind.ESTIMATED:
            f += premise.expression * (sp.Matrix(system.A.coefficients[k].tolist()) * x)
    bounds = np.zeros((2, system.order, system.order))
    for i, component in enumerate(f):
        for j in set(range(system.order)) - measured:
            slope = sp.expand(sp.diff(component, system.state[j]))
            bounds[:, i, j] = enclose(slope, system.domain, _TOLERANCE) if slope.free_symbols else float(slope)
    return bounded_jacobian(*bounds)


def _weighted(taus: list[Variable], matrices: list[Matrix]) -> Expression:
    """``sum_k tau_k Pi_k``."""
    return sum((tau * matrix for tau, matrix in zip(taus[1:], matrices[1:], strict=True)), taus[0] * matrices[0])


def _require_supported(model: PolytopicModel) -> None:
    system = model.system
    refuse = partial(InputError, f"condition {_ID}", system.name)
    if system.C.coefficients.any():
        raise refuse("C with premises", "a constant C")
    estimated = [k for k, premise in enumerate(system.premises) if premise.kind is PremiseKind.ESTIMATED]
    if not estimated:
        raise refuse("no estimated premises", "some; without, sampled-observer")
    if system.E.coefficients[estimated].any() or system.B.coefficients[estimated].any():
        raise refuse("estimated premises in E or B", "them in A only")


CONDITION = Condition(
    id=_ID,
    summary="regular systems with estimated premises: observer for Euler's sampled model",
    reference="this project, after Dehak 2022, III.4",
    representation="per-premise",
    inequalities=inequalities,
    relies_on=(
        Reliance.REGULAR,
        Reliance.NO_UNKNOWN,
        Reliance.INDEX_ONE,
        Reliance.OUTPUTS,
        Reliance.SCHEDULED,
        Reliance.EULER,
        Reliance.DOMAIN,
    ),
    has_multipliers=True,
)
