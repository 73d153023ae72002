"""One question: does this condition hold for this system, in this representation, at these parameters?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import Any

from quasilpv.conditions.condition import Options, Statement
from quasilpv.conditions.registry import condition
from quasilpv.conditions.reliance import refuse_refuted
from quasilpv.lmi.budget import Limits
from quasilpv.polytopes import PolytopicModel, polytopic_model
from quasilpv.polytopes.units import Units
from quasilpv.studies.examination import stated
from quasilpv.systems.catalogue import system_kind
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.system_kind import SystemKind


@dataclass(frozen=True)
class Question:
    """A condition for a system that has a name.

    Attributes:
        system: its id, see `quasilpv.systems.catalogue.system_kind`; a relative path becomes an absolute one. Or a kind
            that has no name any other process could resolve (`quasilpv.systems.own_kind`).
        condition: its id.
        representation: its name, see `quasilpv.polytopes.polytopic_model`; empty for the one the condition was
            published with.
        parameters: of the system, by name, in order of name; defaults for the others.
        options: of the condition.
        limits: of the time and memory of every answer; no part of what is asked.

    Raises:
        InputError: there is no such system, parameter or condition.
    """

    system: str | SystemKind
    condition: str
    representation: str = ""
    parameters: tuple[tuple[str, float], ...] = ()
    options: Options = field(default_factory=Options)
    limits: Limits = field(default_factory=Limits, compare=False)

    def __post_init__(self) -> None:
        """Fill in the representation; refuse what does not exist."""
        if not self.representation:
            object.__setattr__(self, "representation", condition(self.condition).representation)
        object.__setattr__(self, "parameters", tuple(sorted(dict(self.parameters).items())))
        condition(self.condition)
        kind = system_kind(self.system)
        if isinstance(self.system, str):
            object.__setattr__(self, "system", kind.id)
        _system(kind, self.parameters)

    def at(self, point: Mapping[str, float]) -> Question:
        """The same question with some parameters set."""
        return replace(self, parameters=tuple({**dict(self.parameters), **point}.items()))

    def statement(self, units: Units | None = None) -> Statement:
        """The inequalities, for the system in other units if some are given.

        Raises:
            InputError: the condition does not apply to the system, or the representation does not.
        """
        known = condition(self.condition)
        refuse_refuted(known.id, known.relies_on, self.model())
        return self.inequalities(units)

    def inequalities(self, units: Units | None = None) -> Statement:
        """The same whether or not what the condition relies on is there: a solution alone proves nothing.

        Raises:
            InputError: the inequalities cannot be written down for the system, or the representation does not apply.
        """
        return stated(condition(self.condition), self.model(), self.options, units)

    def model(self) -> PolytopicModel:
        """The system in its representation. Errors as `statement`."""
        return polytopic_model(_system(system_kind(self.system), self.parameters), self.representation)

    def to_document(self) -> dict[str, Any]:
        """JSON-able; a fingerprint tells two contents of one file of a user apart."""
        kind = system_kind(self.system)
        return {
            "system": kind.id,
            **({"system_fingerprint": kind.fingerprint} if kind.fingerprint else {}),
            "condition": self.condition,
            "representation": self.representation,
            "parameters": dict(self.parameters),
            "options": asdict(self.options),
        }


@lru_cache(maxsize=8)
def _system(kind: SystemKind, parameters: tuple[tuple[str, float], ...]) -> DescriptorSystem:
    """The system of a question, which is made when the question is, and looked at when it is answered."""
    return kind.system(**dict(parameters))
