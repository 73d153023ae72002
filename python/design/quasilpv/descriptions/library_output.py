"""What a C++ library prints on its own, kept from the terminal."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager

LONGEST = 300


@contextmanager
def captured_stderr() -> Iterator[Callable[[], str]]:
    """Keep what is written to file descriptor 2; yields a function that returns the errors among it, in one line."""
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as file:

        def said() -> str:
            file.seek(0)
            text = file.read().decode(errors="replace")
            return " ".join(text.partition("Error:")[2].replace("Error:", " ").split())[:LONGEST]

        try:
            os.dup2(file.fileno(), 2)
            yield said
        finally:
            os.dup2(kept, 2)
            os.close(kept)
