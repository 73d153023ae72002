"""Control design for nonlinear descriptor systems and robots that carries its proof to the real-time loop.

The names below are the front door: they stay. Each is imported when it is first used, so that ``import quasilpv`` costs
nothing.
"""

from importlib import import_module
from typing import Any

_HOMES = {
    "Answer": "studies.answer",
    "Artifact": "artifact",
    "DescriptorSystem": "systems.descriptor.system",
    "Evidence": "studies.answer",
    "InputError": "errors",
    "Law": "studies.law",
    "Verdict": "studies.answer",
    "boundary": "studies.front_door",
    "controller": "system_chain",
    "design": "chain",
    "export": "exchange",
    "gate": "chain",
    "plot_region": "figures.region",
    "rate": "systems.descriptor.names",
    "region": "studies.front_door",
    "robot": "chain",
    "simulate": "chain",
    "solve": "studies.front_door",
    "stabilise": "system_chain",
    "state_space": "exchange",
    "structure_report": "systems.descriptor.structure",
    "verify": "chain",
}

__all__ = [
    "Answer",
    "Artifact",
    "DescriptorSystem",
    "Evidence",
    "InputError",
    "Law",
    "Verdict",
    "__version__",
    "boundary",
    "controller",
    "design",
    "export",
    "gate",
    "plot_region",
    "rate",
    "region",
    "robot",
    "simulate",
    "solve",
    "stabilise",
    "state_space",
    "structure_report",
    "verify",
]


def __getattr__(name: str) -> Any:
    """A name of the front door, from the module it lives in."""
    if name == "__version__":
        value = _version()
    elif name in _HOMES:
        value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The front door, for completion."""
    return sorted({*globals(), *__all__})


def _version() -> str:
    """Of the package as it is installed."""
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 -- half of what is loaded here

    try:
        return version(__name__)
    except PackageNotFoundError:  # used from a checkout that is not installed
        return "0+unknown"
