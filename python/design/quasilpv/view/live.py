"""A run as it happens: telemetry heard on the wire, the last seconds of it kept."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections import Counter
from typing import Generic, TypeVar

import numpy as np

from quasilpv.artifact import Artifact
from quasilpv.telemetry.listening import listen
from quasilpv.telemetry.log import hash_prefix
from quasilpv.telemetry.message_types import Records, channel_type
from quasilpv.view.playback import Motion

WINDOW_S = 20.0
MOST_SAMPLES = 100_000
"""Kept at most, whatever the rate."""
_POLL_MS = 50

Shown = TypeVar("Shown")


class Live(ABC, Generic[Shown]):
    """Hears telemetry of one artifact in a thread of its own, from creation to `close`.

    Args:
        url: where the processes talk.
        channel: of the telemetry.
        digest: hash of the artifact whose telemetry is wanted; other messages are counted and left alone.
        period_s: of its samples.

    Raises:
        InputError: the URL is none of this machine.
        TransportError: there is no multicast route.

    Attributes:
        refused: messages left alone, by reason.
    """

    def __init__(self, url: str, channel: str, digest: str, period_s: float) -> None:
        """Listen."""
        self.refused: Counter[str] = Counter()
        self._channel, self._hash, self._period_s = channel, hash_prefix(digest), period_s
        self._type = channel_type(channel)
        self._pending: list[bytes] = []
        self._lock = threading.Lock()
        self._kept: Records | None = None
        self._shown: Shown | None = None
        self._closing = threading.Event()
        self._wire = listen(url, self._hear)
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)
        self._thread.start()

    def poll(self) -> Shown | None:
        """The last seconds of the newest session, a new object if there is more; None before its first sample."""
        with self._lock:
            packets, self._pending = self._pending, []
        records = self._type.decode(packets)
        ours = records[records["artifact_hash"] == self._hash]
        self.refused["other artifact"] += int(records.size - ours.size)
        if ours.size and self._extend(ours):
            assert self._kept is not None
            self._shown = self._made(self._kept)
        return self._shown

    def close(self) -> None:
        """Hear no more."""
        self._closing.set()
        self._thread.join()

    @abstractmethod
    def _made(self, records: Records) -> Shown:
        """What is shown of samples of one session, in order, at least one."""

    def _extend(self, records: Records) -> bool:
        """Whether there is anything new."""
        session = records["session"][-1]
        records = records[records["session"] == session]
        _, first = np.unique(records["seq"], return_index=True)
        new = records[first]
        if self._kept is not None and self._kept["session"][0] == session:
            new = new[new["seq"] > self._kept["seq"][-1]]
            if not new.size:
                return False
            new = np.concatenate([self._kept, new])
        since = new["seq"][-1] - WINDOW_S / self._period_s
        self._kept = new[new["seq"] >= since][-MOST_SAMPLES:]
        return True

    def _hear(self, channel: str, data: bytes) -> None:
        if channel != self._channel:
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


class LiveMotion(Live[Motion]):
    """That of a robot. Errors: `Live`."""

    def __init__(self, url: str, artifact: Artifact) -> None:
        """Listen."""
        self._artifact = artifact
        super().__init__(url, "QLPV_TELEMETRY", artifact.hash, artifact.sample_period_s)

    def _made(self, records: Records) -> Motion:
        return Motion.of_telemetry(records, self._artifact)
