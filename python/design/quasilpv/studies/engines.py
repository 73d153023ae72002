"""Where the points of a map are solved: in this process, in several, or on a cluster."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Sequence
from typing import Any

import joblib

from quasilpv.errors import InputError
from quasilpv.studies.answer import Answer
from quasilpv.studies.region import Solver, Task, solve_task


def in_processes(processes: int) -> Solver:
    """Solve on this machine; one process solves in place.

    Args:
        processes: how many, at least 1.
    """

    def solve(tasks: Sequence[Task]) -> Iterable[Answer]:
        if processes == 1 or len(tasks) < 2:
            return map(solve_task, tasks)
        parallel: Any = joblib.Parallel(n_jobs=processes, return_as="generator", batch_size=4)
        answers: Iterable[Answer] = parallel(joblib.delayed(solve_task)(task) for task in tasks)
        return answers

    return solve


def on_cluster(address: str) -> Solver:
    """Solve on a running Dask cluster.

    Args:
        address: of its scheduler, e.g. ``tcp://node:8786``. The workers need this package.

    Raises:
        InputError: Dask is not installed, or there is no scheduler at the address.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise InputError("region", "--dask", "no Dask here", "the package: pip install 'quasilpv[cluster]'") from None
    try:
        client = distributed.Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError("region", "--dask", f"{address} ({error})", "a running Dask scheduler") from None

    def solve(tasks: Sequence[Task]) -> Iterable[Answer]:
        futures = client.map(solve_task, list(tasks), pure=False)
        return (future.result() for future in futures)

    return solve
