"""What an entry of the catalogue of descriptor systems is."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from math import isfinite

from quasilpv.errors import InputError
from quasilpv.systems.descriptor.affine_family import AffineFamily, affine_family
from quasilpv.systems.descriptor.open_parameters import OpenParameters
from quasilpv.systems.descriptor.system import DescriptorSystem


@dataclass(frozen=True)
class Parameter:
    """A number a system of the catalogue depends on.

    Attributes:
        default: the value it has unless another is given.
        summary: one line for a listing.
        unit: its unit, ``"1"`` if it has none.
        affine: the entries of E, A, B and C are jointly affine in all parameters so marked, and neither the premises
            nor their bounds depend on them: a map over them can update the data of a problem instead of rebuilding it.
    """

    default: float
    summary: str
    unit: str = "1"
    affine: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class SystemKind:
    """A parametrised descriptor system. Kinds are the same if id and fingerprint are.

    Attributes:
        id: the name it is known by.
        summary: one line for a listing.
        reference: where it comes from.
        parameters: its parameters by name.
        build: makes the system; called with every parameter by name.
        stem: the id as a part of a file name; the id itself if it is not given.
        left_open: makes the system with some parameters left open and the others as given, where that can be tried
            (`quasilpv.systems.descriptor.affine_family`): what may be marked as affine by nobody is then found out.
        fingerprint: changes with what the system is made from, if that may change (a user's file); empty for the
            catalogue. Results kept for later hold it.
    """

    id: str
    summary: str
    reference: str
    parameters: Mapping[str, Parameter]
    build: Callable[..., DescriptorSystem]
    stem: str = ""
    fingerprint: str = ""
    left_open: Callable[[OpenParameters, Mapping[str, float]], DescriptorSystem] | None = None

    def __post_init__(self) -> None:
        """Take the id for a file name if no other is given."""
        if not self.stem:
            object.__setattr__(self, "stem", self.id)

    def __repr__(self) -> str:
        """In one line."""
        return f"SystemKind({self.id!r}, parameters {', '.join(self.parameters) or 'none'})"

    def __eq__(self, other: object) -> bool:
        """Whether both stand for the same systems."""
        return isinstance(other, SystemKind) and (self.id, self.fingerprint) == (other.id, other.fingerprint)

    def __hash__(self) -> int:
        """By id and fingerprint."""
        return hash((self.id, self.fingerprint))

    def system(self, **parameters: float) -> DescriptorSystem:
        """The system at the given parameters, defaults for the others.

        Raises:
            InputError: a parameter does not exist (those that do are listed), is not finite, or has no meaning.
        """
        for name, value in parameters.items():
            if name not in self.parameters:
                known = f"one of {', '.join(self.parameters)}" if self.parameters else "no parameter"
                raise InputError(self.id, "parameter", name, known)
            if not isfinite(value):
                raise InputError(self.id, name, value, "a finite number")
        defaults = {name: parameter.default for name, parameter in self.parameters.items()}
        return self.build(**(defaults | {name: float(value) for name, value in parameters.items()}))

    def family(self, swept: Collection[str], **parameters: float) -> AffineFamily | None:
        """The systems over some parameters, proved to be affine in them; None if they are not shown to be.

        Args:
            swept: names of these parameters.
            **parameters: values, defaults for the others; of the swept ones, where the family is centred.
        """
        if self.left_open is None or not swept:
            return None
        values = {name: parameter.default for name, parameter in self.parameters.items()} | parameters
        fixed = {name: value for name, value in values.items() if name not in swept}
        make = self.left_open
        family = affine_family(lambda record: make(record, fixed), {name: float(values[name]) for name in swept})
        if family is None:
            return None
        beside = {name: family.base[name] + family.steps[name] for name in family.base}
        return family if family.holds(self.system(**fixed, **beside), beside) else None
