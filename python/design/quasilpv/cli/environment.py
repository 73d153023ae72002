"""What the surroundings of the command must not decide: how figures are drawn, and what libraries say of themselves.

Figures have a style of their own (`quasilpv.figures.style`) and no display; settings that people keep for their own
plots, in variables or in a ``matplotlibrc`` of the current folder, could only break them.
"""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import ModuleType


def settle() -> None:
    """Set what libraries read when they are loaded; to be called before any of them is."""
    os.environ["MPLBACKEND"] = "agg"
    os.environ["MATPLOTLIBRC"] = os.devnull
    os.environ.pop("SOURCE_DATE_EPOCH", None)  # figures hold no date, but one that is no number ends the library
    if not os.environ.get("LOKY_MAX_CPU_COUNT", "1").isdecimal():  # how many processes joblib may start
        del os.environ["LOKY_MAX_CPU_COUNT"]
    sys.meta_path.insert(0, _LoadedElsewhere())
    logging.getLogger("matplotlib").setLevel(logging.CRITICAL)
    if sys.warnoptions:  # a warning of a library is nothing its user can mend, and as an error it ends the command
        warnings.simplefilter("ignore")


class _LoadedElsewhere(MetaPathFinder):
    """Finds matplotlib, which takes a ``matplotlibrc`` of the current folder for its settings while it is loaded."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """As any finder; nothing but that one package."""
        found = PathFinder.find_spec(fullname, path) if fullname == "matplotlib" else None
        if found is not None and found.origin is not None:
            found.loader = _ElsewhereLoader(fullname, found.origin)
        return found


class _ElsewhereLoader(SourceFileLoader):
    """Loads a package away from the current folder."""

    def exec_module(self, module: ModuleType) -> None:
        """As its parent, elsewhere."""
        with away_from_here():
            super().exec_module(module)


@contextmanager
def away_from_here() -> Iterator[None]:
    """Inside, the current folder is that of this file: libraries loaded there find no settings in the user's."""
    here = os.open(".", os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.chdir(Path(__file__).parent)
        yield
    finally:
        os.fchdir(here)
        os.close(here)
