"""Figures of the runs of a command, drawn by other processes while the next run goes on."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path
from types import TracebackType

from quasilpv.cli.console import print_note, progress
from quasilpv.experiments.result import TrackResult
from quasilpv.figures.gallery import write_comparison, write_gallery

MOST_PROCESSES = 4
"""Each takes memory, and two seconds to begin: more would be idle before the next run has ended."""


class Gallery:
    """The figures of every run, and of each scenario with several runs those that show them beside each other.

    One run is drawn in this process, and so are all if there is no second core: another process takes two seconds to
    begin.
    """

    def __init__(self, out: Path, formats: Sequence[str], runs: int) -> None:
        """Say where the folders of the runs are, in which formats to draw, and how many runs there will be."""
        self._out, self._formats = out, formats
        self._workers = _workers(runs) if formats and runs > 1 else None
        self._runs: list[tuple[TrackResult, Future[list[Path]] | None]] = []

    def __enter__(self) -> Gallery:
        """Nothing is begun before the first run."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Leave no process behind; what was not begun is not drawn."""
        if self._workers is not None:
            self._workers.shutdown(cancel_futures=True)

    def add(self, result: TrackResult) -> None:
        """Begin to draw a run."""
        drawn = None
        if self._workers is not None:
            # The process that starts here inherits this: one interrupt, one message.
            with _interrupts_held(), suppress(BrokenExecutor):
                drawn = self._workers.submit(write_gallery, result, self._folder(result), self._formats)
        self._runs.append((result, drawn))

    def finish(self) -> None:
        """Draw what is left, and the comparisons.

        Raises:
            InputError: a folder cannot be written.
        """
        if not self._formats:
            return
        with progress(len(self._runs)) as steps:
            # From the last: what the others have not begun is drawn here, until they have begun what is left.
            for result, drawn in reversed(self._runs):
                steps.begin(f"figures: {result.title}")
                if drawn is None or drawn.cancel() or not _is_drawn(drawn):
                    write_gallery(result, self._folder(result), self._formats)
                steps.end()
        for scenario in dict.fromkeys(result.scenario for result, _ in self._runs):
            runs = [result for result, _ in self._runs if result.scenario == scenario]
            if len(runs) > 1:
                write_comparison(runs, self._out / scenario, self._formats)
        print_note(f"figures are under {self._out}")

    def _folder(self, result: TrackResult) -> Path:
        return self._out / result.scenario / result.variant.slug


def _workers(runs: int) -> ProcessPoolExecutor | None:
    """As many as there are cores beside this process's own, up to `MOST_PROCESSES` and to the runs."""
    import joblib

    spare: int = min(joblib.cpu_count() - 1, runs, MOST_PROCESSES)
    return ProcessPoolExecutor(spare, mp_context=get_context("spawn")) if spare else None


def _is_drawn(drawn: Future[list[Path]]) -> bool:
    """Wait for it; False if nobody drew it: the system may have stopped the process, for want of memory."""
    with suppress(BrokenExecutor):
        return bool(drawn.result())
    return False


@contextmanager
def _interrupts_held() -> Iterator[None]:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
