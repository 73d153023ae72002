"""Files read whole and written whole."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from quasilpv.errors import InputError

MAX_FILE_BYTES = 64 * 1024 * 1024


def read_bytes(path: Path | str) -> bytes:
    """Return the content of a file of at most ``MAX_FILE_BYTES`` bytes.

    Raises:
        InputError: the file is missing, unreadable or too large.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            raise InputError(str(path), "size", f"{size} bytes", f"at most {MAX_FILE_BYTES} bytes")
        return path.read_bytes()
    except OSError as error:
        raise InputError(str(path), "file", error.strerror or error, "a readable file") from error


def readable_json(value: object) -> str:
    """A JSON-able tree as indented text for people, without final newline; numbers in their shortest round-trip form.

    Raises:
        ValueError: a number is not finite.
    """
    return json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False)


def write_readable_json(path: Path, value: object) -> None:
    """Write a JSON-able tree, indented, with a final newline, whole or not at all. Errors as `write_atomically`."""
    write_atomically({path: f"{readable_json(value)}\n".encode()})


def write_atomically(contents: Mapping[Path, bytes]) -> None:
    """Write files so that each has its old or its new content, never a part: temporary files first, then renames.

    Raises:
        InputError: a file cannot be written; the temporary files are removed.
    """
    temporary: dict[Path, Path] = {}
    target = next(iter(contents))
    try:
        for target, data in contents.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}-", delete=False) as file:
                temporary[target] = Path(file.name)
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary[target].chmod(0o644)
        for target, path in temporary.items():
            path.replace(target)
    except OSError as error:
        raise InputError(str(target), "file", error.strerror or error, "a writable file") from error
    finally:
        for path in temporary.values():
            path.unlink(missing_ok=True)


@contextmanager
def written_whole(path: Path) -> Iterator[BinaryIO]:
    """A file to write that is too large to hold: it takes its place when the context ends, or never.

    Args:
        path: of the file; missing folders are made.

    Raises:
        InputError: the file cannot be written; nothing half-written is left behind.
    """
    partial = path.with_name(f".{path.name}-partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            yield file
        partial.replace(path)
    except OSError as error:
        raise InputError(str(path), "file", error.strerror or error, "a writable file") from error
    finally:
        partial.unlink(missing_ok=True)
