"""Hearing an LCM URL."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quasilpv.defaults import DEFAULT_URL
from quasilpv.errors import InputError, TransportError
from quasilpv.telemetry.message_types import CHANNELS, channel_type

if TYPE_CHECKING:
    import lcm

_RECEIVE_BUFFER_BYTES = 4 << 20
"""Asked of the kernel, whose default holds a hundred messages: fewer than a busy machine lets pile up."""
_URL = re.compile(r"udpm://\d+(\.\d+){3}:\d+\?ttl=0")


def listen(url: str, hear: Callable[[str, bytes], None]) -> lcm.LCM:
    """A subscription to every channel of the project; its `handle_timeout` calls ``hear(channel, data)``.

    Of signed messages the tag is taken off unchecked: nothing that listens here acts on the arm.

    Raises:
        InputError: the URL is none of this machine.
        TransportError: there is no multicast route.
        ImportError: LCM is not installed: it comes with the extra ``hil``.
    """
    if not _URL.fullmatch(url):
        raise InputError("command line", "--url", url, f"udpm://ADDRESS:PORT?ttl=0, e.g. {DEFAULT_URL}")
    try:
        wire: lcm.LCM = _lcm().LCM(f"{url}&recv_buf_size={_RECEIVE_BUFFER_BYTES}")
    except RuntimeError as error:
        raise TransportError(f"{url}: {error}") from error

    def hear_content(channel: str, data: bytes) -> None:
        hear(channel, channel_type(channel).content(data) if channel in CHANNELS else data)

    # LCM drops the newest message of a full queue: this one is never full.
    wire.subscribe("QLPV_.*", hear_content).set_queue_capacity(0)
    return wire


def _lcm() -> Any:
    """The module of LCM. What it links of glib it takes from the system, or from beside the executables of a wheel."""
    try:
        return import_module("lcm")
    except ImportError:
        bundled = Path(__file__).parents[1] / "_hil/libglib-2.0.so.0"
        if not bundled.exists():
            raise
        ctypes.CDLL(str(bundled), mode=ctypes.RTLD_GLOBAL)
        return import_module("lcm")
