"""The descriptor systems known by name: the examples of Dehak 2022 and the arms as stabilisation problems.

A new system is one builder in a file of its family and one line here.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from quasilpv.errors import InputError, one_of
from quasilpv.systems.arm_stabilisation import arm2_kind, arm3_kind, frictionless_arm3_kind
from quasilpv.systems.descriptor import DescriptorSystem
from quasilpv.systems.regular_example import regular_example
from quasilpv.systems.singular_examples import rotation_example, singular_example, uncertain_example
from quasilpv.systems.spring_disc import spring_disc
from quasilpv.systems.system_kind import SystemKind

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


def system(name: str, **parameters: float) -> DescriptorSystem:
    """The descriptor system of that name, at the given parameters.

    Raises:
        InputError: no such system or parameter (those there are are listed), or a value that is not finite or has no
            meaning.
    """
    if name not in SYSTEMS:
        raise InputError("systems", "system", name, one_of(SYSTEMS, name))
    return SYSTEMS[name].system(**parameters)
