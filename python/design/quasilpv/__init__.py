"""Control design for nonlinear descriptor systems and robots that carries its proof to the real-time loop.

The names below are the front door: they stay. Each is imported when it is first used, so that ``import quasilpv`` costs
nothing.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

try:
    __version__ = version("quasilpv")
except PackageNotFoundError:  # used from a checkout that is not installed
    __version__ = "0+unknown"

_HOMES = {
    "Answer": "studies.answer",
    "DescriptorSystem": "systems.descriptor",
    "Evidence": "studies.answer",
    "InputError": "errors",
    "Law": "studies.law",
    "Verdict": "studies.answer",
    "boundary": "studies.front_door",
    "rate": "systems.equations",
    "region": "studies.front_door",
    "solve": "studies.front_door",
    "structure_report": "systems.structure",
}

__all__ = [
    "Answer",
    "DescriptorSystem",
    "Evidence",
    "InputError",
    "Law",
    "Verdict",
    "__version__",
    "boundary",
    "rate",
    "region",
    "solve",
    "structure_report",
]


def __getattr__(name: str) -> Any:
    """A name of the front door, from the module it lives in."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The front door, for completion."""
    return sorted({*globals(), *__all__})
