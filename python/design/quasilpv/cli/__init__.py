"""The command `design`: one module per verb, each a thin layer over the package."""

from quasilpv.cli.app import main, run

__all__ = ["main", "run"]
