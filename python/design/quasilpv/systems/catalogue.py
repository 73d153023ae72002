"""The descriptor systems known by name: the examples of Dehak 2022, the arms as stabilisation problems, a user's own.

A new system of the catalogue is one builder in a file of its family and one line here. A system of a user needs no
change here: `system_kind` also takes a name in a Python file, a JSON document of equations and the entry points of
installed packages.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from quasilpv.errors import InputError, one_of
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.document import document_kind
from quasilpv.systems.examples.arm_stabilisation import arm2_kind, arm3_kind, frictionless_arm3_kind
from quasilpv.systems.examples.regular import regular_example
from quasilpv.systems.examples.singular import rotation_example, singular_example, uncertain_example
from quasilpv.systems.examples.spring_disc import spring_disc
from quasilpv.systems.system_kind import SystemKind
from quasilpv.systems.user_code import entry_point_kind, entry_point_kinds, is_python_reference, python_file_kind

_KINDS = (
    regular_example("ex-I.1"),
    regular_example("ex-II.9"),
    rotation_example("ex-II.5"),
    rotation_example("ex-II.6"),
    singular_example("ex-II.7"),
    frictionless_arm3_kind("ex-II.8"),
    uncertain_example("ex-III.10"),
    uncertain_example("ex-III.11"),
    spring_disc("ex-III.12"),
    spring_disc("spring-disc"),
    arm2_kind("arm2"),
    arm3_kind("arm3"),
)

SYSTEMS: Mapping[str, SystemKind] = MappingProxyType({kind.id: kind for kind in _KINDS})


def system_kind(reference: str | SystemKind) -> SystemKind:
    """The system, or the family of systems, that a reference names.

    Every place that takes a system by name goes through here. A reference stands for

    * ``ex-I.1``: an entry of the catalogue,
    * another name: an entry point of the group `ENTRY_POINT_GROUP` of an installed package,
    * ``FILE.py:NAME``: a system, or a function of parameters with defaults, in a Python file, which is executed,
    * ``FILE.json``: a document of equations as text (`quasilpv.systems.document`); nothing is executed.

    A kind stands for itself.

    Returns:
        A kind whose `id` any process of this machine can resolve again: paths are absolute.

    Raises:
        InputError: there is no such system (those there are are listed), or the user's code fails.
    """
    if isinstance(reference, SystemKind):
        return reference
    if reference in SYSTEMS:
        return SYSTEMS[reference]
    if is_python_reference(reference):
        return python_file_kind(reference)
    if reference.endswith(".json"):
        return document_kind(reference)
    installed = entry_point_kinds()
    if reference in installed:
        return entry_point_kind(installed[reference])
    names = one_of(system_names(), reference)
    raise InputError("systems", "system", reference, f"{names}; or FILE.py:NAME, FILE.json")


def system_names() -> list[str]:
    """The references that are plain names: the catalogue, then the entry points of installed packages, not loaded."""
    return [*SYSTEMS, *(name for name in entry_point_kinds() if name not in SYSTEMS)]


def system(name: str, **parameters: float) -> DescriptorSystem:
    """The descriptor system that a reference names (see `system_kind`), at the given parameters.

    Raises:
        InputError: no such system or parameter (those there are are listed), or a value that is not finite or has no
            meaning.
    """
    return system_kind(name).system(**parameters)
