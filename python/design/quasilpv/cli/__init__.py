"""The command `design`: one module per verb, each a thin layer over the package.

Nothing is imported here before it is known that there is room for it: with a stack of a few pages, the libraries behind
the command would end in a segmentation fault.
"""

from __future__ import annotations

import resource
import sys
from collections.abc import Sequence

__all__ = ["main", "run"]

LEAST_STACK_BYTES = 512 << 10


def run(arguments: Sequence[str]) -> int:
    """Run the command with the given arguments and return its exit code; errors are one line on stderr.

    Args:
        arguments: the command line without the program's name.
    """
    from quasilpv.cli import app  # noqa: PLC0415

    return app.run(arguments)


def main() -> None:
    """Entry point of the command ``design``."""
    _require_stack()
    from quasilpv.cli import app  # noqa: PLC0415

    app.main()


def _require_stack() -> None:
    """Take as much stack as the caller allows; end with a line if that is too little."""
    soft, hard = resource.getrlimit(resource.RLIMIT_STACK)
    if soft == resource.RLIM_INFINITY or soft >= LEAST_STACK_BYTES:
        return
    if hard == resource.RLIM_INFINITY or hard >= LEAST_STACK_BYTES:
        resource.setrlimit(resource.RLIMIT_STACK, (LEAST_STACK_BYTES, hard))
        return
    expected = f"at least {LEAST_STACK_BYTES >> 10} kB (ulimit -s)"
    sys.stderr.write(f"error: environment: stack: got {hard >> 10} kB, expected {expected}\n")
    sys.exit(2)
