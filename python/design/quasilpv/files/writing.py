"""The one writer: files are written whole or not at all, beside their place, and then take it.

Only regular files are replaced; a link is followed to the file it names, which keeps its mode and its owner. A new file
has the mode that the umask leaves. Devices, pipes, sockets, folders and inputs of the running command are refused.
"""

from __future__ import annotations

import errno
import json
import os
import secrets
import signal
import stat
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from quasilpv.errors import InputError
from quasilpv.files.command import input_name, note_output
from quasilpv.files.reading import kind_of

TEMPORARY_PREFIX = ".quasilpv-new-"
"""Temporary names do not hold the name of the file, which may be as long as the file system allows."""
_STOPPING = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}


def readable_json(value: object, encoding: str = "utf-8") -> str:
    """A JSON-able tree as indented text for people, without final newline; numbers in their shortest round-trip form.

    Args:
        value: the tree.
        encoding: in which the text must be writable; what is not, such as a name that is not text, is escaped.

    Raises:
        ValueError: a number is not finite.
    """
    text = json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False)
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return json.dumps(value, indent=2, allow_nan=False)
    return text


def write_readable_json(path: Path, value: object) -> None:
    """Write a JSON-able tree, indented, with a final newline, whole or not at all. Errors as `write_atomically`."""
    write_atomically({path: f"{readable_json(value)}\n".encode()})


def write_atomically(contents: Mapping[Path, bytes]) -> None:
    """Write files so that each has its old or its new content, never a part: temporary files first, then renames.

    An input of the running command may be among them if it keeps its content.

    Raises:
        InputError: a file cannot be written; the temporary files are removed.
    """
    with ExitStack() as temporary:
        new: list[_Replacement] = []
        for target, data in contents.items():
            if _is_kept_input(target, data):
                continue
            replacement = temporary.enter_context(_replacing(target))
            if any(replacement.place == other.place for other in new):
                raise InputError(str(target), "file", "another name of a file written too", "a file of its own")
            with _told(target):
                replacement.file.write(data)
            new.append(replacement)
        _publish(*new)


@contextmanager
def written_whole(path: Path) -> Iterator[BinaryIO]:
    """A file to write that is too large to hold: it takes its place when the context ends, or never.

    Args:
        path: of the file; missing folders are made.

    Raises:
        InputError: the file cannot be written; nothing half-written is left behind.
    """
    with _replacing(path) as replacement:
        with _told(path):
            yield replacement.file
        _publish(replacement)


class _Replacement:
    """A new file beside the place it will take.

    Attributes:
        target: the place as it was given.
        place: the regular file that is, links followed.
        temporary: where the new file is until then.
        file: to write it.
    """

    def __init__(self, target: Path, place: Path) -> None:
        self.target, self.place = target, place
        self.temporary = place.with_name(f"{TEMPORARY_PREFIX}{secrets.token_hex(8)}")
        self.file: BinaryIO

    def open(self) -> None:
        """Make the new file, with the mode and the owner of the one it will replace."""
        self.place.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self.temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        self.file = os.fdopen(descriptor, "wb")
        with suppress(FileNotFoundError):
            before = self.place.stat()
            with suppress(PermissionError):
                os.fchown(descriptor, before.st_uid, before.st_gid)
            os.fchmod(descriptor, stat.S_IMODE(before.st_mode))

    def finish(self) -> None:
        """Have everything on the disk."""
        self.file.flush()
        os.fsync(self.file.fileno())
        self.file.close()

    def remove(self) -> None:
        """Leave nothing behind."""
        if hasattr(self, "file"):
            with suppress(OSError):  # what a full disk would not take
                self.file.close()
        self.temporary.unlink(missing_ok=True)


@contextmanager
def _replacing(target: Path) -> Iterator[_Replacement]:
    with _told(target):
        replacement = _Replacement(target, _place_of(target))
    try:
        with _told(target):
            replacement.open()
        yield replacement
    finally:
        replacement.remove()


def _publish(*replacements: _Replacement) -> None:
    """Let new files take their places, with no signal between the first and the last."""
    for replacement in replacements:
        with _told(replacement.target):
            replacement.finish()
    masked = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
    try:
        for replacement in replacements:
            with _told(replacement.target):
                status = replacement.temporary.stat()
                replacement.temporary.replace(replacement.place)
                note_output(status)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, masked)


def _place_of(target: Path) -> Path:
    """The regular file a path stands for, links followed, whether it is there yet or not.

    Raises:
        InputError: it stands for something else, for an input, or for a file that may not be written.
        OSError: it cannot be looked at.
    """
    place = Path(os.path.realpath(target))
    try:
        status = target.stat()
    except FileNotFoundError:
        return place
    if not stat.S_ISREG(status.st_mode):
        raise InputError(str(target), "file", kind_of(status), "a regular file, or a name that is free")
    if (name := input_name(status)) is not None:
        raise InputError(str(target), "file", f"an input of this command ({name})", "another file")
    if not os.access(place, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return place


def _is_kept_input(target: Path, data: bytes) -> bool:
    """Whether a file is an input that holds just this content already."""
    try:
        status = target.stat()
        return input_name(status) is not None and status.st_size == len(data) and target.read_bytes() == data
    except OSError:
        return False


@contextmanager
def _told(target: Path) -> Iterator[None]:
    """What the system has against a file, as a line."""
    try:
        yield
    except OSError as error:
        raise InputError(str(target), "file", error.strerror or error, "a writable file") from error
