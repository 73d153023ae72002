"""Design of a feedback with its region: the inequalities in units a solver likes, an objective, and the way back.

The units (`quasilpv.polytopes.scaling`) bring half-widths of the domain and limits of inputs near one; they are powers
of two, so that the inequalities are the same ones. What comes out is proved by `quasilpv.certificate`, which knows
neither this module nor the units.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from math import inf, isfinite

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.regional.feedback import (
    RegionalLimits,
    RegionalStatement,
    regional_statement,
    require_inputs,
)
from quasilpv.conditions.regional.performance import require_l2_gain
from quasilpv.conditions.regional.volume import geometric_mean_of_eigenvalues
from quasilpv.conditions.reliance import COMPENSATION, Reliance, Status, refuse_refuted, reliances
from quasilpv.documents.system_artifact import BALANCE as BALANCE_MEMBER
from quasilpv.documents.system_artifact import L2_GAIN
from quasilpv.errors import InfeasibleError, InputError
from quasilpv.lmi import Solution, Variable
from quasilpv.polytopes import PolytopicModel, polytopic_model
from quasilpv.polytopes.scaling import ladder
from quasilpv.polytopes.units import Units
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.systems.descriptor.system import DescriptorSystem

BACK_OFFS = (0.001, 0.02)
"""Of the optimum, given up for room in which exact arithmetic can confirm the inequalities; the next if one fails."""

L2_BACK_OFF = 0.1
"""The same of the L2 gain: nearer to the optimum the gains of the feedback grow without bound."""

BALANCE = 4.0
"""By so much the sizes of disturbance and performance grow or shrink together, which changes no gain but the bound of
it: V is at most 1 in the region, and what V' has to outweigh is measured in it."""

MOST_BALANCES = 5
"""So many steps at most."""

DEFAULT_DECAY = 0.1
"""Decay rate if none is asked for, in units of the time in which the system moves by as much as it is."""

FASTEST_STEPS = 14
"""Of the bisection for the largest decay rate."""

REPRESENTATION = "per-premise"


@dataclass(frozen=True, eq=False)
class RegionalDesign:
    """What was found, in the units of the system.

    Attributes:
        request: what was asked for.
        model: the system on its polytope.
        decay_rate: alpha, 1/s.
        lyapunov: P, (q, q): the region is ``x_d' P^-1 x_d <= 1``.
        gains: of the vertices, (N, m, q).
        units: in which the inequalities were solved.
        witness: further matrices of the inequalities, by name, in those units; see
            `quasilpv.certificate.systems.regional`.
    """

    request: RegionalRequest
    model: PolytopicModel
    decay_rate: float
    lyapunov: FloatArray
    gains: FloatArray
    units: Units
    witness: dict[str, FloatArray]

    def at(self, rate_hz: float) -> RegionalDesign:
        """The same, sampled at another rate."""
        return replace(self, request=replace(self.request, rate_hz=rate_hz))

    @property
    def assumed(self) -> tuple[str, ...]:
        """What the inequalities rely on and nothing proves, in words.

        Not that of the domain, which is what the region is for, nor of the state where there is an observer for it.
        """
        relied = reliances(COMPENSATION, self.model)
        shown = {Reliance.DOMAIN, Reliance.STATE} if self.request.measured else {Reliance.DOMAIN}
        return tuple(
            f"{one.name}: {one.detail}" for one in relied if one.status is Status.ASSUMED and one.reliance not in shown
        )

    @property
    def extent(self) -> FloatArray:
        """Largest magnitude of every differential state in the region, (q,)."""
        return np.asarray(np.sqrt(np.diag(self.lyapunov)))


def design_feedback(
    request: RegionalRequest, progress: Progress = no_progress, most_units: int | None = None
) -> RegionalDesign:
    """The best feedback and region.

    Args:
        request: what is asked for.
        progress: called with (steps done, steps in all).
        most_units: so many units are tried; None for all of them.

    Raises:
        InputError: nothing bounds the region in some direction, a domain does not hold the trim, or what the
            inequalities rely on is refuted, for instance because an algebraic equation folds.
        InfeasibleError: no feedback was found, in any of the units tried.
    """
    if request.unbounded is not None:
        expected = "an interval, a limit of every input, or a bound of the speed: nothing else bounds the region there"
        raise InputError(request.system.name, f"domain of {request.unbounded}", "none", expected)
    widened = tuple(premise.widened() for premise in request.system.premises)
    model = polytopic_model(replace(request.system, premises=widened), REPRESENTATION)
    refuse_refuted("regional feedback", COMPENSATION, model)
    found: list[RegionalDesign] = []
    for units in islice(_units(request), most_units):
        search = _Search(request, model, units)
        design = search.found(progress)
        if design is not None:
            found.append(design)
            break
    if not found:
        raise InfeasibleError(
            f"{request.system.name}: no feedback was found that keeps a region inside the domain with these limits; "
            "ask for less decay, more input, or a smaller domain (its premises vary less)"
        )
    return found[0]


def default_decay_rate(system: DescriptorSystem) -> float:
    """`DEFAULT_DECAY` in units of the time in which the system moves by as much as it is, 1/s."""
    units = next(ladder(system))
    return DEFAULT_DECAY / (1.0 if units is None else units.c)


def _units(request: RegionalRequest) -> Iterator[Units]:
    """Those of the ladder, with states in half-widths of the domain and inputs in their limits; then its own."""
    system = request.system
    n, m, outputs = system.order, len(system.inputs), system.C.shape[0]
    plain = Units((0,) * n, (0,) * m, (0,) * outputs, (0,) * n, 0, system.differential)
    for own in ladder(system):
        base = own or plain
        state = _exponents(request.bounds_of_states, base.state)
        inputs = _exponents(request.limits_of_inputs, base.inputs)
        rows = _row_exponents(system, state, base.time)
        yield replace(base, state=state, inputs=inputs, rows=rows)
        yield base


def _exponents(bounds: tuple[float, ...], otherwise: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(
        int(np.round(np.log2(bound))) if isfinite(bound) else exponent
        for bound, exponent in zip(bounds, otherwise, strict=True)
    )


def _row_exponents(system: DescriptorSystem, state: tuple[int, ...], time: int) -> tuple[int, ...]:
    """Exponents that bring the largest entry of every row of (E, A) near one."""
    scale = np.ldexp(1.0, np.array(state))
    spread = 0.5 * (system.upper - system.lower)
    sizes = [
        (np.abs(X.evaluate(0.5 * (system.lower + system.upper))) + np.tensordot(spread, np.abs(X.coefficients), axes=1))
        * scale
        * factor
        for X, factor in ((system.E, 2.0**-time), (system.A, 1.0))
    ]
    largest = np.maximum(*sizes).max(axis=1)
    return tuple(int(-np.round(np.log2(size))) if size > 0.0 else 0 for size in largest)


def _gain(design: RegionalDesign | None) -> float:
    return inf if design is None else float(design.witness[L2_GAIN][0, 0])


@dataclass(frozen=True)
class _Search:
    """A request in units."""

    request: RegionalRequest
    model: PolytopicModel
    units: Units

    def limits(self, decay_rate: float) -> RegionalLimits:
        """The limits in the units, ``decay_rate`` in them too."""
        request, units = self.request, self.units
        return RegionalLimits(
            decay_rate=decay_rate,
            states=tuple((np.array(request.bounds_of_states) / units.T).tolist()),
            inputs=tuple((np.array(request.limits_of_inputs) / units.S).tolist()),
            speed=inf if request.speed is None else request.speed * units.c,
        )

    @property
    def decay_rate(self) -> float:
        """Asked for or by default, in the units."""
        asked = self.request.decay_rate
        return (default_decay_rate(self.request.system) if asked is None else asked) * self.units.c

    def found(self, progress: Progress) -> RegionalDesign | None:
        """By the objective."""
        if self.request.objective == "fastest":
            return self.fastest(progress)
        return self.least_l2_gain() if self.request.objective == "least-l2-gain" else self.best()

    def best(self) -> RegionalDesign | None:
        """Largest region, or the least of a gain."""
        limits = self.limits(self.decay_rate)
        if self.request.objective == "least-gain":
            limits = replace(limits, inputs=(inf,) * len(limits.inputs))
        statement = self._statement(limits)
        if self.request.objective == "least-gain":
            self._cover(statement)
            share = Variable("share", 1)
            require_inputs(statement, self._rescaled, self.limits(self.decay_rate).inputs, share)
            statement.problem.minimise(share)
        else:
            statement.problem.minimise(-geometric_mean_of_eigenvalues(statement.problem, statement.P))
        return self._inside(statement, self.decay_rate)

    def least_l2_gain(self) -> RegionalDesign | None:
        """Over the balance of V and the sizes: larger and smaller by factors, as long as that helps."""
        found = {0: self._balanced(0)}
        for direction in (1, -1):
            step = direction
            while abs(step) <= MOST_BALANCES:
                found[step] = self._balanced(step)
                if _gain(found[step]) >= _gain(found[step - direction]):
                    break
                step += direction
        return min(found.values(), key=_gain)

    def _balanced(self, step: int) -> RegionalDesign | None:
        balance = BALANCE**step
        statement = self._statement(self.limits(self.decay_rate))
        self._cover(statement)
        gain = Variable(L2_GAIN, 1)
        require_l2_gain(statement, self._rescaled, *self._performance(balance), gain)
        statement.problem.minimise(gain)
        found = self._inside(statement, self.decay_rate)
        return found and replace(found, witness={**found.witness, BALANCE_MEMBER: np.array([[balance]])})

    def fastest(self, progress: Progress) -> RegionalDesign | None:
        """By bisection: the inequalities are not linear in the decay rate."""
        low, high, best = 0.0, DEFAULT_DECAY, None
        for step in range(FASTEST_STEPS):
            progress(step, FASTEST_STEPS)
            rate = high if best is None or low == high / 2.0 else 0.5 * (low + high)
            statement = self._statement(self.limits(rate))
            self._cover(statement)
            found = self._inside(statement, rate)
            if found is not None:
                low, best = rate, found
                high = 2.0 * rate if rate == high else high
            elif best is None:
                high = rate / 4.0
            else:
                high = rate
        return best

    @property
    def _rescaled(self) -> PolytopicModel:
        return PolytopicModel(self.units.of(self.model.system), self.model.polytope)

    def _statement(self, limits: RegionalLimits) -> RegionalStatement:
        return regional_statement(self._rescaled, limits)

    def _cover(self, statement: RegionalStatement) -> None:
        """Require the region to hold the ellipsoid of the stated share of the domain."""
        bounds = np.array(self.limits(0.0).states[: self.model.differential])
        bounded = [k for k, bound in enumerate(bounds) if isfinite(bound)]
        choose = np.zeros((len(bounded), len(bounds)), dtype=int).astype(object)
        choose[np.arange(len(bounded)), bounded] = 1
        floor = np.diag((self.request.share * bounds[bounded]) ** 2)
        statement.problem.positive("cover", choose @ statement.P @ choose.T - floor)

    def _performance(self, balance: float) -> tuple[list[float], list[float]]:
        """Factors of disturbance and performance in the units, for sizes that are so many times larger."""
        units, request = self.units, self.request
        factors = [*units.T, *units.S]
        rates = [units.c] * len(units.T) + [1.0] * len(units.S)
        disturbance = zip(request.sizes(request.disturbance), rates, factors, strict=True)
        output = zip(request.sizes(request.performance), factors, strict=True)
        return (
            [size * balance * c / t for size, c, t in disturbance],
            [t / (size * balance) if size else 0.0 for size, t in output],
        )

    def _inside(self, statement: RegionalStatement, decay_rate: float) -> RegionalDesign | None:
        """As near to the optimum as exact arithmetic confirms; without an objective all are the same."""
        for back_off in (L2_BACK_OFF,) if self.request.objective == "least-l2-gain" else BACK_OFFS:
            solution = statement.problem.solve_inside(back_off)
            if solution.verified or not solution.values:
                break
        return self._design(statement, solution, decay_rate)

    def _design(self, statement: RegionalStatement, solution: Solution, decay_rate: float) -> RegionalDesign | None:
        if not solution.verified:
            return None
        units, values = self.units, solution.values
        T, S = units.T_differential, units.S
        inverse = np.linalg.inv(values[statement.P])
        return RegionalDesign(
            request=self.request,
            model=self.model,
            decay_rate=decay_rate / units.c,
            lyapunov=T[:, None] * values[statement.P] * T,
            gains=np.stack([S[:, None] * (values[M] @ inverse) / T for M in statement.M]),
            units=units,
            witness={name: values[unknown] for name, unknown in statement.further.items()},
        )
