"""Control design for nonlinear descriptor systems and robots that carries its proof to the real-time loop."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("quasilpv")
except PackageNotFoundError:  # used from a checkout that is not installed
    __version__ = "0+unknown"

__all__ = ["__version__"]
