"""The command `design`: one module per verb, each a thin layer over the package.

Nothing is imported here before it is known that there is room for it: with a stack of a few pages, the libraries behind
the command would end in a segmentation fault.
"""

from __future__ import annotations

import resource
import sys
from collections.abc import Sequence

__all__ = ["main", "run"]

LEAST_STACK_KIB = 1024
"""As for the executables. Below about 96 KiB the interpreter itself does not start, and nobody is left to say so."""


def run(arguments: Sequence[str]) -> int:
    """Run the command with the given arguments and return its exit code; errors are one line on stderr.

    Args:
        arguments: the command line without the program's name.
    """
    from quasilpv.cli import app

    return app.run(arguments)


def main() -> None:
    """Entry point of the command ``design``."""
    _require_stack()
    from quasilpv.cli import app

    app.main()


def _require_stack() -> None:
    """Take as much stack as the caller allows; end with a line if that is too little."""
    soft, hard = (limit >> 10 if limit != resource.RLIM_INFINITY else LEAST_STACK_KIB for limit in _stack_limits())
    if soft >= LEAST_STACK_KIB:
        return
    if hard >= LEAST_STACK_KIB:
        resource.setrlimit(resource.RLIMIT_STACK, (LEAST_STACK_KIB << 10, _stack_limits()[1]))
        return
    expected = f"at least {LEAST_STACK_KIB} KiB (ulimit -s)"
    sys.stderr.write(f"error: process: stack limit: got {hard} KiB, expected {expected}\n")
    sys.exit(2)


def _stack_limits() -> tuple[int, int]:
    """Soft and hard limit, bytes."""
    return resource.getrlimit(resource.RLIMIT_STACK)
