"""What a condition relies on besides its inequalities, and what of it can be proved of a model.

A solution of the inequalities is worth what its premises are: a law with ``E(z)^-1`` in it needs an invertible E(z), a
law that is scheduled with a premise needs its value. Every condition names these as data (`Condition.relies_on`);
`reliances` says of a model which of them are proved, refuted or assumed. What is refuted is refused by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from weakref import WeakKeyDictionary

import sympy as sp

from quasilpv.conditions.invertibility import proof_of_invertibility
from quasilpv.errors import InputError
from quasilpv.lmi.exact import null_space, to_rational
from quasilpv.polytopes import PolytopicModel
from quasilpv.systems.descriptor.premise import PremiseKind
from quasilpv.systems.descriptor.structure import Finding, Standing, StructureReport, structure_report
from quasilpv.systems.descriptor.system import DescriptorSystem


class Reliance(StrEnum):
    """What a condition may rely on; the values are what people read."""

    REGULAR = "no algebraic states"
    INVERTIBLE_E = "E(z) invertible"
    """For laws with ``E(z)^-1`` in them whose inequalities do not imply it."""
    KNOWN_E = "no unknown premise in E(z)"
    INDEX_ONE = "index one"
    """E_1(z) and A_22(z) invertible, where the inequalities imply both of the open loop."""
    CLOSED_INDEX_ONE = "index one of the closed loop"
    """The same where the law changes both."""
    ASSUMPTION_1 = "Assumption 1: premises of differential states"
    NO_UNKNOWN = "no unknown premise"
    STATE = "state known to the law"
    DERIVATIVES = "derivatives of the state known to the law"
    SCHEDULED = "premises known to the law"
    MEASURED = "premises measured"
    """Computed from outputs and measured parameters alone; an observer that is scheduled with them needs it."""
    OUTPUTS = "outputs"
    EULER = "Euler's sampled model"
    DOMAIN = "state and parameters in their domain"


COMPENSATION = (
    Reliance.INDEX_ONE,
    Reliance.ASSUMPTION_1,
    Reliance.STATE,
    Reliance.SCHEDULED,
    Reliance.DOMAIN,
)
"""Of laws ``F(z) x_d`` in the extended form."""

DESCRIPTOR_LAW = (
    Reliance.REGULAR,
    Reliance.KNOWN_E,
    Reliance.INVERTIBLE_E,
    Reliance.STATE,
    Reliance.SCHEDULED,
    Reliance.DOMAIN,
)
"""Of laws ``F(z) E(z)^-T P^-1 x``."""


class Status(StrEnum):
    """How far something a condition relies on is established."""

    PROVED = "proved"
    REFUTED = "refuted"
    ASSUMED = "assumed"


@dataclass(frozen=True)
class Relied:
    """One thing a condition relies on, for one model.

    Attributes:
        reliance: what.
        status: how far it is established; what is assumed is for the user to see to.
        detail: why, with the names of premises and states.
    """

    reliance: Reliance
    status: Status
    detail: str

    @property
    def name(self) -> str:
        """What people read."""
        return self.reliance.value


MUST_BE_PROVED = frozenset({Reliance.INVERTIBLE_E})
"""What nobody can be expected to see to: a condition is not stated if it is merely assumed."""


def reliances(relies_on: Sequence[Reliance], model: PolytopicModel) -> tuple[Relied, ...]:
    """What of the things a condition relies on is proved, refuted or assumed for a model.

    What the inequalities of a condition imply counts as proved: without a solution there is nothing to rely on.

    Args:
        relies_on: of a condition, `Condition.relies_on`.
        model: the system in its representation.

    Returns:
        One entry for each, in order: ``(name, status, detail)`` are its properties.
    """
    return tuple(Relied(reliance, *_CHECKS[reliance](model)) for reliance in relies_on)


class RefusedError(InputError):
    """A condition does not apply to a system: something it relies on is refuted, or has to be proved and is not."""


def refuse_refuted(condition: str, relies_on: Sequence[Reliance], model: PolytopicModel) -> None:
    """Refuse what is refuted, and what is in `MUST_BE_PROVED` and is not.

    Index one is refused where it is missing by construction. Where E_1(z) or A_22(z) is singular at some z only, the
    inequalities can be stated and have no solution: their infeasibility is then the answer, with a proof.

    Args:
        condition: its id.
        relies_on: of the condition.
        model: the system in its representation.

    Raises:
        RefusedError: something is refused; names it.
    """
    for reliance in relies_on:
        if reliance not in _EXPECTED:
            continue
        check = _index_one_at_all if reliance is Reliance.INDEX_ONE else _CHECKS[reliance]
        status, detail = check(model)
        if status is Status.REFUTED or (status is Status.ASSUMED and reliance in MUST_BE_PROVED):
            raise RefusedError(f"condition {condition}", model.system.name, detail, _EXPECTED[reliance])


_Found = tuple[Status, str]


def _regular(model: PolytopicModel) -> _Found:
    algebraic = model.order - model.differential
    if algebraic:
        return Status.REFUTED, f"{algebraic} algebraic states"
    return Status.PROVED, "every state has an equation for its rate"


def _invertible(model: PolytopicModel) -> _Found:
    reason = proof_of_invertibility(model.system)
    if reason is not None:
        return Status.PROVED, reason
    return _of_finding("E(z) singular", _structure(model.system).leading)


def _known_descriptor(model: PolytopicModel) -> _Found:
    within = [p for p in sorted(model.polytope.unknown) if model.system.E.coefficients[p].any()]
    if within:
        return Status.REFUTED, f"unknown premise {_names(model.system, within)} in E(z), which the law would need"
    return Status.PROVED, "E(z) depends on premises the law is given"


def _index_one(model: PolytopicModel) -> _Found:
    if model.constant_descriptor and model.order == model.differential and proof_of_invertibility(model.system):
        return Status.PROVED, "E is constant and invertible"
    report = _structure(model.system)
    for block, finding in (("E_1(z)", report.leading), ("A_22(z)", report.algebraic_pivot)):
        if finding.standing is Standing.REFUTED:
            return Status.REFUTED, f"not index one: {block} singular, {finding.reason}"
    return Status.PROVED, "E_1(z) and A_22(z) are invertible: the inequalities imply it"


def _index_one_at_all(model: PolytopicModel) -> _Found:
    """Refuted if a block is singular at the centre of the box and at another point of it: not by chance."""
    q, system = model.differential, model.system
    points = [system.lower + share * (system.upper - system.lower) for share in (0.5, 0.6171875)]
    for name, matrix, rows in (("E_1(z)", system.E, slice(0, q)), ("A_22(z)", system.A, slice(q, None))):
        at_points = (to_rational(matrix.evaluate(z)[rows, rows]) for z in points)
        if all(null_space(block).shape[1] for block in at_points):
            return Status.REFUTED, f"not index one: {name} is singular"
    return Status.PROVED, "not missing by construction"


def _closed_index_one(model: PolytopicModel) -> _Found:
    B = model.system.B
    q = model.differential
    if not (B.constant[q:].any() or B.coefficients[:, q:].any()):
        pivot = _structure(model.system).algebraic_pivot
        if pivot.standing is Standing.REFUTED:
            return Status.REFUTED, f"not index one: no input reaches the algebraic equations, {pivot.reason}"
    return Status.PROVED, "the inequalities imply it"


def _assumption_1(model: PolytopicModel) -> _Found:
    if model.order == model.differential:
        return Status.PROVED, "there are no algebraic states"
    return _of_finding("Assumption 1", _structure(model.system).assumption_1)


def _no_unknown(model: PolytopicModel) -> _Found:
    if model.polytope.unknown:
        return Status.REFUTED, f"unknown premises {_names(model.system, sorted(model.polytope.unknown))}"
    return Status.PROVED, "there is none"


def _state(model: PolytopicModel) -> _Found:
    system = model.system
    unseen = null_space(to_rational(system.C.constant))
    hidden = [symbol.name for symbol, row in zip(system.state, unseen, strict=True) if row.any()]
    if system.C.coefficients.any():
        hidden = [symbol.name for symbol in system.state]
    if hidden:
        return Status.ASSUMED, f"no output gives {', '.join(hidden)}: to be estimated"
    return Status.PROVED, "the outputs give every state"


def _derivatives(model: PolytopicModel) -> _Found:
    rates = ", ".join(f"{symbol.name}'" for symbol in model.system.state[: model.differential])
    return Status.ASSUMED, f"{rates} are measured or estimated"


def _scheduled(model: PolytopicModel) -> _Found:
    return _premises(model, [p for p in range(model.polytope.premises) if p not in model.polytope.unknown])


def _measured(model: PolytopicModel) -> _Found:
    status, detail = _premises(model, range(model.polytope.premises))
    hidden = [p for p in range(model.polytope.premises) if not _from_outputs(model.system, p)]
    if hidden:
        return Status.REFUTED, f"premises {_names(model.system, hidden)} of states that no output gives"
    return status, detail


def _outputs(model: PolytopicModel) -> _Found:
    if model.system.C.shape[0] == 0:
        return Status.REFUTED, "no outputs"
    return Status.PROVED, f"{model.system.C.shape[0]} outputs"


def _euler(model: PolytopicModel) -> _Found:
    return Status.ASSUMED, "what is proved is of the model E(z_k)(x_k+1 - x_k) = h (A(z_k) x_k + B(z_k) u_k)"


def _domain(model: PolytopicModel) -> _Found:
    left_over = max(map(abs, model.system.disturbance), default=0.0)
    beside = f"; a constant disturbance of at most {left_over:.2g} is left out" if left_over else ""
    used = {symbol for premise in model.system.premises for symbol in premise.expression.free_symbols}
    if not used:
        return Status.PROVED, f"the model holds everywhere{beside}"
    return (
        Status.ASSUMED,
        f"{', '.join(sorted(symbol.name for symbol in used))} stay in it: nothing here proves that{beside}",
    )


_CHECKS: Mapping[Reliance, Callable[[PolytopicModel], _Found]] = {
    Reliance.REGULAR: _regular,
    Reliance.INVERTIBLE_E: _invertible,
    Reliance.KNOWN_E: _known_descriptor,
    Reliance.INDEX_ONE: _index_one,
    Reliance.CLOSED_INDEX_ONE: _closed_index_one,
    Reliance.ASSUMPTION_1: _assumption_1,
    Reliance.NO_UNKNOWN: _no_unknown,
    Reliance.STATE: _state,
    Reliance.DERIVATIVES: _derivatives,
    Reliance.SCHEDULED: _scheduled,
    Reliance.MEASURED: _measured,
    Reliance.OUTPUTS: _outputs,
    Reliance.EULER: _euler,
    Reliance.DOMAIN: _domain,
}

# Of everything that can be refuted.
_EXPECTED: Mapping[Reliance, str] = {
    Reliance.REGULAR: "a regular system (E(z) invertible)",
    Reliance.INVERTIBLE_E: "an E(z) that is invertible over the domain, which the law has the inverse of",
    Reliance.KNOWN_E: "unknown premises in A, B and C only; write the equations so that E is free of them",
    Reliance.INDEX_ONE: "a system of index one",
    Reliance.CLOSED_INDEX_ONE: "a system that feedback makes one of index one",
    Reliance.ASSUMPTION_1: "premises of differential states (Assumption 1)",
    Reliance.NO_UNKNOWN: "a system without",
    Reliance.MEASURED: "premises that outputs give; for the others, estimated-observer",
    Reliance.OUTPUTS: "at least one",
}


# ---- what the checks share -------------------------------------------------------------------------------------------

_REPORTS: WeakKeyDictionary[DescriptorSystem, StructureReport] = WeakKeyDictionary()


def _structure(system: DescriptorSystem) -> StructureReport:
    """The structure report, made once per system."""
    if system not in _REPORTS:
        _REPORTS[system] = structure_report(system)
    return _REPORTS[system]


def _of_finding(refuted: str, finding: Finding) -> _Found:
    if finding.holds:
        return Status.PROVED, finding.reason
    if finding.standing is Standing.REFUTED:
        return Status.REFUTED, f"{refuted}: {finding.reason}"
    return Status.ASSUMED, f"not proved: {finding.reason}"


def _premises(model: PolytopicModel, which: Sequence[int]) -> _Found:
    """Whether outputs give some premises; parameters are measured where the system says so."""
    system = model.system
    estimated = [p for p in which if not _from_outputs(system, p)]
    if estimated:
        return Status.ASSUMED, f"to be estimated: {_names(system, estimated)}"
    states = set(system.state)
    outside = sorted({s.name for p in which for s in system.premises[p].expression.free_symbols - states})
    if outside:
        return Status.ASSUMED, f"to be measured: {', '.join(outside)}"
    return Status.PROVED, "the outputs give every premise" if which else "there is none"


def _from_outputs(system: DescriptorSystem, p: int) -> bool:
    """Whether a premise is a function of ``y = C x`` and of parameters, as far as that can be proved."""
    premise = system.premises[p]
    if premise.kind is PremiseKind.ESTIMATED:
        return False
    if system.C.coefficients.any():
        return not premise.expression.free_symbols & set(system.state)
    for direction in null_space(to_rational(system.C.constant)).T:
        moved = [(symbol, factor) for symbol, factor in zip(system.state, direction, strict=True) if factor]
        slopes = [sp.Rational(factor) * sp.diff(premise.expression, symbol) for symbol, factor in moved]
        if any(slopes) and (len(moved) == 1 or sp.simplify(sum(slopes)) != 0):
            return False
    return True


def _names(system: DescriptorSystem, premises: Sequence[int]) -> str:
    """Names of premises with their expressions where these say more."""
    shown = [system.premises[p] for p in premises]
    return ", ".join(p.name if str(p.expression) == p.name else f"{p.name} = {p.expression}" for p in shown)
