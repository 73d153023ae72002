"""The exceptions of the package: a small hierarchy, one line per message.

Misuse raises; the *outcome* of a computation (a solver that stops, a specification that is infeasible) is a value and never
an exception of this module.
"""

from __future__ import annotations


class QuasilpvError(Exception):
    """Root of every exception this package raises on purpose; its message is one line fit for a terminal."""


class InputError(QuasilpvError):
    """A value given by the user cannot be used.

    Args:
        source: where the value came from, e.g. a file name, a class or ``"arm3"``.
        field: which value, e.g. ``"links[1].inertia_kg_m2"``.
        got: what was found (``str`` of it is printed, on one line).
        expected: what is accepted, in words.
    """

    def __init__(self, source: str, field: str, got: object, expected: str) -> None:
        self.source = source
        self.field = field
        self.got = " ".join(str(got).split())
        self.expected = expected
        super().__init__(f"{source}: {field}: got {self.got}, expected {expected}")

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str, str]]:
        """Rebuild from the four parts, so that the error survives a process boundary (parallel sweeps)."""
        return type(self), (self.source, self.field, self.got, self.expected)
