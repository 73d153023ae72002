"""Mistakes in the use of the command line, in the form of every other error: field, got, expected."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import typer

from quasilpv.defaults import LARGEST_WRITTEN
from quasilpv.errors import InputError, one_of

if TYPE_CHECKING:
    from pydantic import ValidationError

NUMBERS = {"float_parsing": "a number", "int_parsing": "a whole number", "int_from_float": "a whole number"}
NUMBER_EXPECTED = f"a number between -{LARGEST_WRITTEN:g} and {LARGEST_WRITTEN:g}"
_DECIMAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
LIMITS = {"greater_than_equal": ("at least", "ge"), "less_than_equal": ("at most", "le")}


def usage_error(error: typer.TyperException) -> InputError:
    """What the parser refused, as a line that names the verb whose help explains it."""
    context = getattr(error, "ctx", None)
    field, got, expected = _parts(error, context)
    return InputError(
        "command line", field, got, f"{expected} ({context.command_path if context else 'design'} --help)"
    )


def require_values(arguments: Sequence[str]) -> None:
    """Refuse what stands for a value and is none: ``--out ""`` or ``--out=``, often an unset variable of a shell.

    Raises:
        InputError: an argument, or the value of an option, is empty.
    """
    for before, argument in zip(["", *arguments], arguments, strict=False):
        option, separator, value = argument.partition("=")
        if separator and option.startswith("--") and not value:
            raise InputError("command line", option, "nothing", "a value")
        if not argument:
            field = before if before.startswith("-") else "arguments"
            raise InputError("command line", field, "nothing", "a value")


def require_bounded(parameter: Any, value: object) -> None:
    """Refuse numbers that are not finite or larger than `LARGEST_WRITTEN`.

    Args:
        parameter: an option or argument of a verb.
        value: what was given for it, or its default.

    Raises:
        InputError: the option, and what is accepted.
    """
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if is_number and not abs(value) <= LARGEST_WRITTEN:  # type: ignore[arg-type]  # NaN compares with nothing
        raise InputError("command line", _name(parameter), f"{value:g}", NUMBER_EXPECTED)


def number(text: str) -> float | None:
    """A number as a person types it, finite and at most `LARGEST_WRITTEN` in magnitude; None if it is none."""
    value = float(text) if _DECIMAL.fullmatch(text) else math.nan
    return value if abs(value) <= LARGEST_WRITTEN else None


def _parts(error: typer.TyperException, context: Any) -> tuple[str, str, str]:
    """Field, got, expected; of mistakes the parser has its own words for, those."""
    from pydantic import ValidationError

    parameter = getattr(error, "param", None)
    field = "arguments" if parameter is None else _name(parameter)
    option = getattr(error, "option_name", None)
    if isinstance(error.__cause__, ValidationError):
        return (field, *_value(error.__cause__))
    if parameter is not None and not getattr(error, "message", ""):
        return field, "nothing", _first_sentence(parameter.help) or "a value"
    if option is not None and hasattr(error, "possibilities"):
        declared = (parameter.opts for parameter in context.command.get_params(context))
        options = [name for names in declared for name in sorted(names) if name.startswith("-")]  # -h and --help: a set
        return "option", option, one_of(options, option)
    if option is not None:
        return (option, "a value", "none") if "does not take" in str(error) else (option, "nothing", "a value")
    extra = re.fullmatch(r"Got unexpected extra argument\(s\) \((.*)\)", getattr(error, "message", ""))
    if extra:
        known = [_name(one) for one in context.command.get_params(context) if one.param_type_name == "argument"]
        return field, f"{extra[1]} too", f"no more than {' '.join(known) or 'options'}"
    return field, error.format_message(), "another use"


def _name(parameter: Any) -> str:
    """As a person types it: the long form of an option, an argument as its help shows it."""
    if parameter.param_type_name == "option":
        return str(max(parameter.opts, key=len))
    return str(parameter.metavar or parameter.name.upper())


def _value(error: ValidationError) -> tuple[str, str]:
    """Got and expected of a value of the wrong type or out of range."""
    first = error.errors(include_url=False)[0]
    kind, context = first["type"], first.get("ctx", {})
    got = str(first["input"])
    if kind in NUMBERS:
        return got, NUMBERS[kind]
    if kind in LIMITS:
        words, key = LIMITS[kind]
        return got, f"{words} {context[key]:g}"
    return got, _choices(first["msg"], context)


def _choices(message: str, context: Mapping[str, Any]) -> str:
    """The choices a message about an unknown one lists; else the message."""
    _, listed, choices = str(context.get("error", message)).partition(" is not one of ")
    return f"one of {choices.replace(chr(39), '').rstrip('.')}" if listed else message


def _first_sentence(text: str | None) -> str:
    """The first sentence of a help text, to go on with after a comma."""
    sentence = (text or "").partition(".  [")[0].partition(". ")[0].rstrip(".")
    return sentence if sentence[:2].isalpha() and sentence[:2].isupper() else sentence[:1].lower() + sentence[1:]
