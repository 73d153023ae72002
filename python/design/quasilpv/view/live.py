"""A run as it happens: telemetry heard on the wire, kept as a motion of the last seconds."""

from __future__ import annotations

import threading
from collections import Counter

import numpy as np

from quasilpv.artifact import Artifact
from quasilpv.telemetry.listening import listen
from quasilpv.telemetry.log import hash_prefix
from quasilpv.telemetry.message_types import channel_type
from quasilpv.view.playback import Motion

WINDOW_S = 20.0
_POLL_MS = 50


class LiveMotion:
    """Hears telemetry of one artifact in a thread of its own, from creation to `close`.

    Args:
        url: where the processes talk.
        artifact: whose telemetry is wanted; other messages are counted and left alone.

    Raises:
        InputError: the URL is none of this machine.
        TransportError: there is no multicast route.

    Attributes:
        refused: messages left alone, by reason.
    """

    def __init__(self, url: str, artifact: Artifact) -> None:
        """Listen."""
        self.refused: Counter[str] = Counter()
        self._artifact = artifact
        self._type = channel_type("QLPV_TELEMETRY")
        self._pending: list[bytes] = []
        self._lock = threading.Lock()
        self._motion: Motion | None = None
        self._session: int | None = None
        self._closing = threading.Event()
        self._wire = listen(url, self._hear)
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)
        self._thread.start()

    def poll(self) -> Motion | None:
        """The last seconds of the newest session so far; None before its first sample."""
        with self._lock:
            packets, self._pending = self._pending, []
        records = self._type.decode(packets)
        ours = records[records["artifact_hash"] == hash_prefix(self._artifact.hash)]
        self.refused["other artifact"] += int(records.size - ours.size)
        if ours.size:
            self._extend(ours)
        return self._motion

    def close(self) -> None:
        """Hear no more."""
        self._closing.set()
        self._thread.join()

    def _extend(self, records: np.ndarray) -> None:
        session = int(records["session"][-1])
        if session != self._session:
            self._session, self._motion = session, None
        records = records[records["session"] == session]
        _, first = np.unique(records["seq"], return_index=True)
        new = Motion.of_telemetry(records[first], self._artifact)
        if self._motion is None:
            self._motion = new
            return
        later = new[new.time_s > self._motion.time_s[-1]]
        if later.samples:
            self._motion = self._motion.followed_by(later, WINDOW_S)

    def _hear(self, channel: str, data: bytes) -> None:
        if channel != "QLPV_TELEMETRY":
            return
        reason = self._type.refusal(data)
        if reason is not None:
            self.refused[reason] += 1
            return
        with self._lock:
            self._pending.append(data)

    def _run(self) -> None:
        while not self._closing.is_set():
            self._wire.handle_timeout(_POLL_MS)
