"""Arguments of the front door are of the types it states: another one is told like every other mistake, by name.

``@checked`` reads the annotations of a function when it is first called; what it knows nothing of, it lets pass.
"""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Mapping
from enum import Enum
from functools import cache, wraps
from math import isfinite
from typing import Any, Literal, ParamSpec, SupportsFloat, SupportsIndex, TypeVar, Union, Unpack, get_args, get_origin
from typing import get_type_hints as hints_of

from quasilpv.errors import InputError

_PLAIN: Mapping[Any, str] = {
    float: "a finite number",
    int: "a whole number",
    str: "a text",
    bool: "True or False",
    type(None): "None",
}

P = ParamSpec("P")
R = TypeVar("R")


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The same function, which refuses arguments of other types than it states.

    Raises:
        InputError: of the function that is returned: it names the function, the argument, what was got and expected.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = signature.bind(*args, **kwargs)  # TypeError, as ever: a name that the function does not have
        hints = _hints(function)
        for name, value in bound.arguments.items():
            hint = hints.get(name)
            if get_origin(hint) is Unpack:
                each = hints_of(get_args(hint)[0])
                for option in set(value) & set(each):
                    _require(function.__name__, option, value[option], each[option])
            elif hint is not None:
                several = signature.parameters[name].kind is inspect.Parameter.VAR_POSITIONAL
                for each_value in value if several else (value,):
                    _require(function.__name__, name, each_value, hint)
        return function(*args, **kwargs)

    return call


@cache
def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    return hints_of(function)


def _require(source: str, name: str, value: object, hint: Any) -> None:
    if not _fits(value, hint):
        raise InputError(source, name, _got(value), _words(hint))


def _fits(value: object, hint: Any) -> bool:
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return any(_fits(value, part) for part in parts)
    if origin is Literal:
        return isinstance(value, str) and value in parts
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return isinstance(value, Mapping) and all(
            _fits(key, parts[0]) and _fits(entry, parts[1]) for key, entry in value.items()
        )
    if origin is tuple and Ellipsis not in parts:
        return isinstance(value, tuple | list) and len(value) == len(parts) and all(map(_fits, value, parts))
    return _is_a(value, hint if origin is None else origin)


def _is_a(value: object, kind: Any) -> bool:
    """Whether a value is of a plain type; numbers of numpy, sympy and fractions are numbers, bools and texts not."""
    if kind is float:
        if not isinstance(value, SupportsFloat) or isinstance(value, bool) or getattr(value, "ndim", 0) != 0:
            return False
        try:
            return isfinite(float(value))
        except (TypeError, OverflowError):  # a symbol, a complex number; more than doubles hold
            return False
    if kind is int:
        return isinstance(value, SupportsIndex) and not isinstance(value, bool) and getattr(value, "ndim", 0) == 0
    if kind is Any or not isinstance(kind, type):
        return True  # Any, a variable of a type, a word that is no type
    return isinstance(value, kind)


def _got(value: object) -> str:
    if isinstance(value, str):
        return value or "an empty text"
    return repr(value) if isinstance(value, int | float | tuple | list | dict | None) else type(value).__name__


def _words(hint: Any) -> str:
    """A type in words."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(_words(part) for part in parts))
    if origin is tuple:
        return f"({', '.join(_words(part) for part in parts)})"
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return f"a mapping from names to {'numbers' if parts[1] is float else 'values'}"
    if choices := parts if origin is Literal else _members(hint):
        return f"one of {', '.join(map(str, choices))}"
    return _PLAIN.get(hint) or ("a function" if origin is Callable else str(getattr(origin or hint, "__name__", hint)))


def _members(hint: Any) -> list[Any]:
    return [member.value for member in hint] if inspect.isclass(hint) and issubclass(hint, Enum) else []
