"""What one command reads, writes and claims.

An input is a file that the command read before it wrote it; the writer refuses to replace one by anything else. A claim
keeps other commands out of a folder, or away from a file, until the command ends; it is a lock of the kernel on a small
file, so it disappears with its process, however that ends.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from quasilpv.errors import InputError

Identity: TypeAlias = tuple[int, int]
"""Device and inode: the same for every name of a file."""

LOCK_NAME = ".quasilpv-lock"
_NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EBADF, errno.EINVAL}
"""What file systems without locks answer; there is nothing to claim there."""
_HOLDER_BYTES = 200


@dataclass
class _Command:
    """The command that runs.

    Attributes:
        line: as it was typed, for whoever finds a folder claimed.
        inputs: files it has read, with the name it knew them by.
        made: files it has written itself.
        claimed: places that are its own until its end.
        claims: to give back then.
    """

    line: str
    inputs: dict[Identity, str] = field(default_factory=dict)
    made: set[Identity] = field(default_factory=set)
    claimed: set[str] = field(default_factory=set)
    claims: ExitStack = field(default_factory=ExitStack)

    def claim(self, folder: Path, name: str, meant: Path) -> None:
        """Hold the lock ``name`` in a folder, unless it is held already."""
        place = os.path.realpath(folder / name)
        if place not in self.claimed:
            self.claims.enter_context(_claimed(folder, name, meant))
            self.claimed.add(place)


_running: list[_Command] = []
"""The commands of this process, the innermost last: a process runs one at a time."""


@contextmanager
def one_command(line: str) -> Iterator[None]:
    """Inside, inputs are known and protected, and claims are held.

    Args:
        line: the command as a person knows it.
    """
    command = _Command(line)
    _running.append(command)
    try:
        with command.claims:
            yield
    finally:
        _running.remove(command)


def identity(status: os.stat_result) -> Identity:
    """What tells a file from every other one."""
    return status.st_dev, status.st_ino


def note_input(path: Path, status: os.stat_result) -> None:
    """Remember that the running command, if there is one, has read a file, unless it made it itself."""
    if _running and identity(status) not in _running[-1].made:
        _running[-1].inputs.setdefault(identity(status), str(path))


def note_output(status: os.stat_result) -> None:
    """Remember that the running command, if there is one, has made a file."""
    if _running:
        _running[-1].inputs.pop(identity(status), None)
        _running[-1].made.add(identity(status))


def input_name(status: os.stat_result) -> str | None:
    """By which name the running command has read this file; None if it has not."""
    return _running[-1].inputs.get(identity(status)) if _running else None


def forget_input(path: Path) -> None:
    """Let a file be replaced although it was read: one of our own keeping, such as a damaged entry of a cache."""
    with suppress(OSError):
        note_output(path.stat())


def claim_folder(folder: Path) -> None:
    """Claim a folder for the outputs of the running command, if there is one; it is made if it is missing.

    Raises:
        InputError: another command is writing there, which is named; or the folder cannot be written.
    """
    if _running:
        _running[-1].claim(folder, LOCK_NAME, folder)


def claim_file(path: Path) -> None:
    """Claim a file that the running command, if there is one, will write. Errors as `claim_folder`."""
    place = Path(os.path.realpath(path))
    name = f"{LOCK_NAME}-{hashlib.sha256(os.fsencode(place.name)).hexdigest()[:16]}"
    if _running:
        _running[-1].claim(place.parent, name, path)


@contextmanager
def _claimed(folder: Path, name: str, meant: Path) -> Iterator[None]:
    """The lock ``name`` in a folder, which is made for it and removed with it if nothing else came into it."""
    with ExitStack() as undo:
        try:
            for missing in reversed([place for place in (folder, *folder.parents) if not os.path.lexists(place)]):
                missing.mkdir(exist_ok=True)
                undo.callback(_remove_if_empty, missing)
            descriptor = _lock(folder / name, meant)
        except OSError as error:
            raise InputError(str(meant), "folder", error.strerror or error, "a folder that can be written") from error
        undo.callback(os.close, descriptor)
        undo.callback((folder / name).unlink, missing_ok=True)
        yield


def _lock(lock: Path, meant: Path) -> int:
    """A descriptor that holds the lock; its file says who does."""
    while True:
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = os.pread(descriptor, _HOLDER_BYTES, 0).decode(errors="replace") or "another command"
            os.close(descriptor)
            expected = "one command at a time: wait for its end, or give another one with -o"
            raise InputError(str(meant), "output", f"the output of {holder} too", expected) from error
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                os.close(descriptor)
                raise
        if os.path.exists(lock) and identity(os.stat(lock)) == identity(os.fstat(descriptor)):
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"process {os.getpid()}, {_running[-1].line}".encode(errors="replace"), 0)
            return descriptor
        os.close(descriptor)  # its holder has just removed it: the lock is that of a file without a name


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
