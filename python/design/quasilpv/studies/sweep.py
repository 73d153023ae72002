"""A question at many parameter points, built once where its data are affine in the swept parameters."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from quasilpv.conditions.condition import Form
from quasilpv.conditions.invertibility import proof_of_invertibility
from quasilpv.conditions.registry import condition
from quasilpv.conditions.reliance import RefusedError, Reliance, refuse_refuted
from quasilpv.errors import InputError
from quasilpv.lmi.budget import limited
from quasilpv.lmi.common import common_problem
from quasilpv.lmi.compiled import CompiledFamily, CompiledProblem, compile_family
from quasilpv.lmi.feasibility import decide
from quasilpv.lmi.rescaled import powers_between, rescaled
from quasilpv.polytopes import BlockPolytope, PolytopicModel, polytopic_model
from quasilpv.polytopes.scaling import ladder
from quasilpv.polytopes.units import Units
from quasilpv.studies.affordable import require_affordable, within_limits
from quasilpv.studies.answer import Answer, Verdict
from quasilpv.studies.answering import answer_of, case_of
from quasilpv.studies.examination import Finding, examine, no_solution, solution, stated
from quasilpv.studies.question import Question
from quasilpv.studies.refutation import IMPLIED
from quasilpv.systems.catalogue import system_kind
from quasilpv.systems.descriptor.premise import AffineMatrix

BETWEEN = 0.40625
"""How far from the base of a family, in every parameter, no coefficient is expected to vanish."""

_POLYNOMIAL = frozenset(IMPLIED) - {"I.3"}
"""Conditions whose inequalities, as published, are polynomials in E, A and B: no norms, pivots or ranks of them."""

_INPUTS = 2  # of E, A, B


class Sweep:
    """A question at many parameter points: built once where its data are affine in the swept parameters.

    Args:
        question: at any point.
        swept: names of the parameters that change.
    """

    def __init__(self, question: Question, swept: Sequence[str]) -> None:
        """Compile the family, if it is one."""
        self.question = question
        self.swept = tuple(swept)
        known = condition(question.condition)
        left = {Reliance.INVERTIBLE_E, Reliance.INDEX_ONE} if self.swept else set()  # these may depend on the point
        refuse_refuted(known.id, [one for one in known.relies_on if one not in left], question.model())
        fixed = {name: value for name, value in question.parameters}
        own = system_kind(question.system).family(self.swept, **fixed) if known.id in _POLYNOMIAL else None
        self._own = own
        self._powers: dict[Units, npt.NDArray[np.intp] | None] = {}
        with limited(question.limits):
            self._family = self._compile()

    @property
    def updates(self) -> bool:
        """Whether points update numbers (True) or rebuild the problem (False)."""
        return self._family is not None

    def at(self, point: Mapping[str, float]) -> Answer:
        """Answer at a point.

        Args:
            point: a value for every swept parameter.
        """
        return within_limits(self.question, lambda: self._at(point))

    def _at(self, point: Mapping[str, float]) -> Answer:
        start = time.perf_counter()
        compiled = self._problem([point])
        require_affordable(self.question, compiled.layout)
        decision = decide(compiled)
        if decision.feasible:
            finding = solution(decision, 1)
        else:
            case = replace(
                case_of(self.question, compiled, lambda: self._model(point)),
                sketch=self._sketch(point),
                in_units=lambda units: self._in_units(compiled, units),
            )
            finding = examine(case, decision)
        refused = self._refused([point]) if finding.verdict is Verdict.FEASIBLE else None
        if refused is not None:
            finding = Finding(Verdict.UNKNOWN, None, refused, decision)
        return answer_of(compiled, finding, start)

    def _refused(self, points: Sequence[Mapping[str, float]]) -> str | None:
        """Why a solution of the inequalities proves nothing at these points and between them; None if it does."""
        known = condition(self.question.condition)
        if not self.swept or Reliance.INVERTIBLE_E not in known.relies_on:
            return None
        sketches = [self._sketch(point) or self._model(point) for point in points]
        if proof_of_invertibility(*(sketch.system for sketch in sketches)) is not None:
            return None
        if len({sketch.system.E.constant.tobytes() for sketch in sketches}) > 1:
            return "E(z) is not proved invertible between the points"
        try:
            refuse_refuted(known.id, known.relies_on, self._model(points[0]))
        except RefusedError as error:
            return error.got
        return None

    def common(self, points: Sequence[Mapping[str, float]], *, rescaled: bool = True) -> Answer:
        """One solution for several points: it holds in their whole convex hull (`quasilpv.lmi.common`).

        A verdict other than feasible says nothing about any point.

        Args:
            points: values for every swept parameter.
            rescaled: if there is none in the units of the system, look for one in others too.

        Raises:
            ValueError: the data are not affine in the swept parameters.
        """
        return within_limits(self.question, lambda: self._common(points, rescaled))

    def _common(self, points: Sequence[Mapping[str, float]], rescaled: bool) -> Answer:
        start = time.perf_counter()
        compiled = self._problem(points)
        require_affordable(self.question, compiled.layout)
        decision, units = decide(compiled), None
        if rescaled and not decision.feasible and self._units is not None:
            decision, units = decide(self._problem(points, self._units)), self._units
        proves = decision.feasible and self._refused(points) is None
        finding = solution(decision, 1, units=units) if proves else no_solution(decision)
        return answer_of(compiled, finding, start)

    def proves(
        self, points: Sequence[Mapping[str, float]], witness: Sequence[float], units: Units | None = None
    ) -> bool:
        """Whether the witness of an answer proves it, in exact arithmetic.

        Args:
            points: that the answer was about.
            witness, units: of the answer.
        """
        compiled = self._problem(points, units)
        holds = len(witness) == len(compiled.layout.kept) and compiled.holds_exactly(np.array(witness))
        return holds and self._refused(points) is None

    def _problem(self, points: Sequence[Mapping[str, float]], units: Units | None = None) -> CompiledProblem:
        """The inequalities at all these points, in one set of unknowns."""
        places = [{name: point[name] for name in self.swept} for point in points]
        another = self._own is not None and len(places) == 1 and not self._is_member(places[0])
        if self._family is not None and units is None and not another:
            return common_problem(self._family, places)
        if len(points) == 1:
            return CompiledProblem.of(self.question.at(places[0]).inequalities(units).problem)
        if self._family is None or units != self._units or self._rescaled is None:
            raise ValueError(f"the data are not affine in {', '.join(self.swept)}: points have nothing in common")
        return common_problem(self._rescaled, places)

    @cached_property
    def _units(self) -> Units | None:
        """Units for several points at once: those fitted first at the question's own point."""
        return next(ladder(self._samples[0][1].system)) if self._family is not None else None

    @cached_property
    def _rescaled(self) -> CompiledFamily | None:
        """The family in those units."""
        return self._compiled(self._units)

    def _in_units(self, own: CompiledProblem, units: Units) -> CompiledProblem | None:
        """A member of the family in other units, if it is known how."""
        if self._family is None:
            return None
        if units not in self._powers:
            base, steps = (self._base(), {}) if self._own is None else (self._own.base, self._own.steps)
            place = {name: value + BETWEEN * steps.get(name, 1.0) for name, value in base.items()}
            statement = stated(condition(self.question.condition), self._model(place), self.question.options, units)
            other = CompiledProblem.of(statement.problem)
            self._powers[units] = powers_between(self._family.at(place), other)
        powers = self._powers[units]
        return None if powers is None else rescaled(own, powers)

    def _sketch(self, point: Mapping[str, float]) -> PolytopicModel | None:
        """The system at a point, up to rounding, where it need not be built anew; the premises are those of all."""
        if self._family is None:
            return None
        (base, origin), *slopes = self._samples
        if self._own is not None:
            return self._member(point, origin.polytope)
        system = origin.system
        moved: dict[str, Any] = {}
        for name in "EABC":
            start: AffineMatrix = getattr(system, name)
            constant, coefficients = start.constant.copy(), start.coefficients.copy()
            for swept, (_, other) in zip(self.swept, slopes, strict=True):
                step: AffineMatrix = getattr(other.system, name)
                distance = point[swept] - base[swept]
                constant += distance * (step.constant - start.constant)
                coefficients += distance * (step.coefficients - start.coefficients)
            moved[name] = AffineMatrix(constant, coefficients)
        return PolytopicModel(replace(system, **moved), origin.polytope)

    @cached_property
    def _samples(self) -> list[tuple[dict[str, float], PolytopicModel]]:
        """The system at a point, and one step further along every swept parameter."""
        base = self._base()
        if self._own is not None:
            return [(dict(self._own.base), self._model(self._own.base))]
        points = [base, *({**base, name: base[name] + 1.0} for name in self.swept)]
        return [(place, self.question.at(place).model()) for place in points]

    def _base(self) -> dict[str, float]:
        parameters = system_kind(self.question.system).parameters
        return {name: dict(self.question.parameters).get(name, parameters[name].default) for name in self.swept}

    def _compile(self) -> CompiledFamily | None:
        parameters = system_kind(self.question.system).parameters
        affine = self._own is not None or all(parameters[name].affine for name in self.swept)
        return self._compiled(None) if self.swept and affine else None

    def _compiled(self, units: Units | None) -> CompiledFamily | None:
        """The family of inequalities, in units if some are given."""
        known, options = condition(self.question.condition), self.question.options
        if self._own is None:
            return compile_family(lambda point: self.question.at(point).inequalities(units).problem, self._base())
        if any(slopes[_INPUTS].any() for slopes in self._own.slopes.values()):
            options = replace(options, form=Form.PUBLISHED)  # reduced ones look at the null space of B, which may jump
        return compile_family(
            lambda point: stated(known, self._model(point), options, units).problem, self._own.base, self._own.steps
        )

    def _model(self, point: Mapping[str, float]) -> PolytopicModel:
        """The system at a point in the representation asked for; of a family of a user's, its member."""
        if self._own is not None and (found := self._member(point)) is not None:
            return found
        return self.question.at(point).model()

    def _is_member(self, point: Mapping[str, float]) -> bool:
        """Whether the system at a point has the states and the algebraic equations of the user's family."""
        return self._member(point, self._samples[0][1].polytope) is not None

    def _member(self, point: Mapping[str, float], polytope: BlockPolytope | None = None) -> PolytopicModel | None:
        """The system of the user's family; None where it is another one there: a state without a rate at L = 0."""
        if self._own is None:
            return None
        try:
            member = self._own.at(point)
        except InputError:
            return None
        if polytope is not None:
            return PolytopicModel(member, polytope)
        return polytopic_model(member, self.question.representation)
