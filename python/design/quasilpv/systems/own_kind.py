"""Systems that live in the running program: a `DescriptorSystem`, or a function of parameters that makes one."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from hashlib import sha256
from itertools import count
from typing import TypeAlias

import numpy as np
import sympy as sp

from quasilpv.errors import InputError
from quasilpv.systems.catalogue import system_kind
from quasilpv.systems.descriptor.open_parameters import OpenParameters
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.system_kind import Parameter, SystemKind
from quasilpv.systems.user_code import like_default, numeric_parameters

SystemLike: TypeAlias = str | SystemKind | DescriptorSystem | Callable[..., DescriptorSystem]
"""What a question may be about; a text is a reference, see `quasilpv.systems.catalogue.system_kind`."""

_made = count()


def own_kind(system: SystemLike) -> SystemKind:
    """The system, or the family of systems, that something stands for.

    Args:
        system: a reference; or a system; or a function of parameters with defaults, of which those that are numbers are
            the parameters of the family.

    Raises:
        InputError: it is none of these, or a reference that names nothing.
    """
    if isinstance(system, str | SystemKind):
        return system_kind(system)
    if isinstance(system, DescriptorSystem):
        return SystemKind(
            id=system.name,
            summary=f"{system.name}, {system.order} states",
            reference="this program",
            parameters={},
            build=_Constant(system),
            fingerprint=fingerprint(system),
        )
    if not callable(system):
        expected = "a DescriptorSystem, a function of parameters with defaults that makes one, or the name of one"
        raise InputError("systems", "system", f"the {type(system).__name__} {system!r:.40}", expected)
    name = str(getattr(system, "__name__", type(system).__name__))
    parameters = numeric_parameters(system, name)
    build = _Function(system, name, tuple((known, number.default) for known, number in parameters.items()))
    return SystemKind(
        id=name,
        summary=f"{name}, a function of {', '.join(parameters) or 'nothing'}",
        reference="this program",
        parameters={known: Parameter(float(number.default), "") for known, number in parameters.items()},
        build=build,
        fingerprint=f"{os.getpid()}-{next(_made)}",  # nobody can tell two functions of the same name apart later
        left_open=build.left_open,
    )


def fingerprint(system: DescriptorSystem) -> str:
    """A digest of everything a system consists of: of every field of its class, whatever fields it may gain."""
    parts = [f"{field.name} {_text(getattr(system, field.name))}" for field in fields(system)]
    return sha256("\n".join(parts).encode()).hexdigest()


def _text(value: object) -> str:
    """The same for equal values of the kinds a system is made of, and for no others."""
    if isinstance(value, np.ndarray):
        return f"{value.shape} {value.dtype} {value.tobytes().hex()}"
    if isinstance(value, sp.Basic):
        return str(sp.srepr(value))
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_text(key)}: {_text(entry)}' for key, entry in value.items())}}}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))})"
    if is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}({', '.join(_text(getattr(value, field.name)) for field in fields(value))})"
    return repr(value)


@dataclass(frozen=True)
class _Constant:
    """Always the same system."""

    system: DescriptorSystem

    def __call__(self) -> DescriptorSystem:
        return self.system


@dataclass(frozen=True)
class _Function:
    """What a function of the program makes."""

    function: Callable[..., DescriptorSystem]
    name: str
    defaults: tuple[tuple[str, float], ...]

    def __call__(self, **values: float) -> DescriptorSystem:
        defaults = dict(self.defaults)
        made = self.function(**{name: like_default(defaults[name], value) for name, value in values.items()})
        if not isinstance(made, DescriptorSystem):
            raise InputError(self.name, "result", f"the {type(made).__name__} {made!r:.40}", "a DescriptorSystem")
        return made

    def left_open(self, record: OpenParameters, fixed: Mapping[str, float]) -> DescriptorSystem:
        """What it makes with open numbers for some parameters."""
        defaults = dict(self.defaults)
        typed = {name: like_default(defaults[name], value) for name, value in fixed.items()}
        return self.function(**typed, **record.numbers())
