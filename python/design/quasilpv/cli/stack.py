"""The stack of the process: numerical libraries and recursive readers end a process that has too little of it."""

from __future__ import annotations

import resource

from quasilpv.errors import InputError

LEAST_STACK_KIB = 1024
"""As for the executables. Below about 96 KiB the interpreter itself does not start, and nobody is left to say so."""


def require_stack() -> None:
    """Refuse to begin with a stack that something would overrun.

    Raises:
        InputError: the limit is too low.
    """
    limit = resource.getrlimit(resource.RLIMIT_STACK)[0]
    if limit != resource.RLIM_INFINITY and limit < LEAST_STACK_KIB * 1024:
        raise InputError(
            "process", "stack limit", f"{limit // 1024} KiB", f"at least {LEAST_STACK_KIB} KiB (ulimit -s)"
        )
