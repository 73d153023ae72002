"""Files read whole."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from quasilpv.errors import InputError
from quasilpv.files.command import note_input

MAX_FILE_BYTES = 64 * 1024 * 1024


def read_bytes(path: Path | str) -> bytes:
    """Return the content of a file of at most ``MAX_FILE_BYTES`` bytes; it becomes an input of the running command.

    Raises:
        InputError: the file is missing, unreadable or too large.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            status = os.fstat(file.fileno())
            data = file.read(MAX_FILE_BYTES + 1)  # of a device or a pipe the size is not known before
    except OSError as error:
        raise InputError(str(path), "file", error.strerror or error, "a readable file") from error
    if len(data) > MAX_FILE_BYTES:
        size = f"{status.st_size} bytes" if stat.S_ISREG(status.st_mode) else "more"
        raise InputError(str(path), "size", size, f"at most {MAX_FILE_BYTES} bytes")
    note_input(path, status)
    return data


def read_large(path: Path | str, expected: str) -> bytes:
    """Return the content of a regular file of any size; it becomes an input of the running command.

    Args:
        path: of the file.
        expected: what it should be, in words.

    Raises:
        InputError: the file is missing, unreadable, or a device, a pipe or a folder.
    """
    path = Path(path)
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(str(path), "file", kind_of(status), expected)
        data = path.read_bytes()
    except OSError as error:
        raise InputError(str(path), "file", error.strerror or error, expected) from error
    note_input(path, status)
    return data


def kind_of(status: os.stat_result) -> str:
    """What a name in a folder stands for, in words."""
    kinds = {
        stat.S_IFREG: "a file",
        stat.S_IFDIR: "a folder",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
        stat.S_IFIFO: "a named pipe",
        stat.S_IFSOCK: "a socket",
    }
    return kinds.get(stat.S_IFMT(status.st_mode), "something else")
