"""The standard streams of the command, whatever they are connected to.

The answer of a verb goes to standard output. If that cannot take it, the verb has not answered, and its exit code must
not say it has: a full disk or a closed stream is a line and exit code 2; a reader that has left is exit code 141, as of
tools that the signal SIGPIPE ends. What is told on standard error is lost quietly if nobody can be told.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast

from quasilpv.errors import InputError


class ReaderLeftError(Exception):
    """The reader of the pipe that standard output is has left; there is nobody to be told."""


class _Guarded:
    """A stream in place of another one, of which it has everything but `write` and `flush`."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.used = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write; what the encoding of the stream lacks is escaped."""
        self.used = self.used or bool(text)
        try:
            return self._stream.write(text)
        except UnicodeEncodeError:
            encoding = self._stream.encoding
            return self._stream.write(text.encode(encoding, "backslashreplace").decode(encoding))
        except (OSError, ValueError) as error:
            return self._lost(error)

    def flush(self) -> None:
        """Hand on what is still kept."""
        try:
            self._stream.flush()
        except (OSError, ValueError) as error:
            self._lost(error)

    def _lost(self, error: Exception) -> int:
        """Nothing that was or will be written arrives, not even when the interpreter ends."""
        with suppress(OSError, ValueError), open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), self._stream.fileno())
        return self._told(error)

    def _told(self, error: Exception) -> int:
        return 0


class _Answer(_Guarded):
    """Standard output: what is lost there is an answer."""

    def _told(self, error: Exception) -> int:
        if isinstance(error, BrokenPipeError):
            raise ReaderLeftError from error
        reason = getattr(error, "strerror", None) or error
        raise InputError("standard output", "stream", reason, "one that takes the answer") from error


@contextmanager
def guarded_streams() -> Iterator[None]:
    """Inside, standard output and standard error are guarded, and at the end everything has arrived.

    Raises:
        InputError: standard output could not take all of it.
        ReaderLeftError: likewise, because its reader has left.
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = cast(TextIO, _Answer(sys.stdout)), cast(TextIO, _Guarded(sys.stderr))
    try:
        yield
        sys.stdout.flush()
    finally:
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


def answered() -> bool:
    """Whether anything was written on a guarded standard output."""
    return isinstance(sys.stdout, _Answer) and sys.stdout.used


def open_missing_streams() -> None:
    """Open what the caller has closed: else the next file would be standard output, and print would write into it.

    Whatever is then written on standard output is refused by the system, as on the closed stream.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY if name == "stderr" else os.O_RDONLY)
            if nowhere != number:
                os.dup2(nowhere, number)
                os.close(nowhere)
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", errors="backslashreplace", closefd=False))
