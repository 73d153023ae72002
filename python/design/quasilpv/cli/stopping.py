"""Being asked to stop: signals become an exception, so that everything that was begun is undone on the way out."""

from __future__ import annotations

import signal
from types import FrameType
from typing import NoReturn


class Stopped(BaseException):
    """A signal asked the process to stop.

    Attributes:
        signal: which one.
    """

    def __init__(self, number: int) -> None:
        """Keep the signal."""
        self.signal = signal.Signals(number)
        super().__init__(self.signal.name)


def raise_when_stopped() -> None:
    """From now on SIGTERM and SIGHUP raise `Stopped`, once: a second one ends the process at once.

    A signal that the caller had ignored, as nohup does, stays ignored.
    """
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _raise)


def _raise(number: int, _: FrameType | None) -> NoReturn:
    signal.signal(number, signal.SIG_DFL)
    raise Stopped(number)
