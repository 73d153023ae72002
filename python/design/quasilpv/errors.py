"""The exceptions of the package: a small hierarchy, one line per message.

Misuse raises; the *outcome* of a computation (a solver that stops, a specification that is infeasible) is a value and
never an exception of this module.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import TypeVar

T = TypeVar("T")

MOST_NAMES = 24
MOST_CHARACTERS = 300
"""Of what was found and where, in a message: a line is to be read."""


class QuasilpvError(Exception):
    """Root of every exception this package raises on purpose; its message is one line fit for a terminal."""


class InputError(QuasilpvError):
    """A value given by the user cannot be used.

    >>> import quasilpv as ql
    >>> ql.solve("ex-I.1", "II.66")
    Traceback (most recent call last):
    quasilpv.errors.InputError: ...
    """

    def __init__(self, source: str, field: str, got: object, expected: str) -> None:
        """Compose the one-line message ``source: field: got ..., expected ...``.

        Args:
            source: where the value came from, e.g. a file name, a class or ``"arm3"``.
            field: which value, e.g. ``"links[1].inertia_kg_m2"``.
            got: what was found (``str`` of it is printed, on one line; of a long one the beginning and its length).
            expected: what is accepted, in words.
        """
        self.source = source
        self.field = field
        self.got = " ".join(str(got).split())
        self.expected = expected
        super().__init__(f"{_beginning(source)}: {_beginning(field)}: got {_beginning(self.got)}, expected {expected}")

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str, str]]:
        """Rebuild from the four parts, so that the error survives a process boundary (parallel sweeps)."""
        return type(self), (self.source, self.field, self.got, self.expected)


def _beginning(text: str) -> str:
    """The text, if it is short, else its beginning and how much there is of it."""
    if len(text) <= MOST_CHARACTERS:
        return text
    return f"{text[:MOST_CHARACTERS]}... ({len(text)} characters)"


def one_of(names: Iterable[str], got: str, listed_by: str = "design list") -> str:
    """What was expected where a name is unknown: the names there are, and the one that was probably meant.

    Args:
        names: those known; of more than `MOST_NAMES` only the closest are printed.
        got: the unknown one.
        listed_by: where all of them are to be seen.
    """
    known = list(names)
    close = get_close_matches(got, known, n=3)
    if len(known) > MOST_NAMES:
        return f"{', '.join([*close, 'one' if not close else 'or another'])} of {listed_by}"
    listed = f"one of {', '.join(known)}"
    return f"{listed}; did you mean {close[0]}?" if close else listed


def look_up(known: Mapping[str, T], name: str, source: str, field: str) -> T:
    """What a name stands for.

    Args:
        known: by name.
        name: the one that is looked up.
        source, field: of the error.

    Raises:
        InputError: there is none of this name; the message lists those there are.
    """
    if name not in known:
        raise InputError(source, field, name, one_of(known, name))
    return known[name]


class PlantError(QuasilpvError):
    """The plant could not be integrated, or reached a configuration where it is not defined (exit code 6)."""


class TransportError(QuasilpvError):
    """No transport between controller and plant (exit code 5)."""


class FaultStop(QuasilpvError):  # noqa: N818 -- the machine's word: a stop, not a mistake of the program
    """The controller latched a fault and stopped the run (exit code 3)."""


class InfeasibleError(QuasilpvError):
    """A specification cannot be met: no design exists in the family that was searched (exit code 1)."""


class ClaimError(QuasilpvError):
    """A run did not show what it was to show, e.g. two runs that must be identical differ (exit code 1)."""
