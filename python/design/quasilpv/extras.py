"""What only an extra of the package installs, and the line that says so where it is missing."""

from __future__ import annotations

from quasilpv.errors import InputError

EXTRAS = {"cvxpy": "oracles", "lcm": "hil", "mcap": "hil", "trimesh": "view", "viser": "view"}
"""Module and extra, of `pyproject.toml`. Those not named here are asked for where they are used."""


def missing_extra(error: ImportError) -> InputError | None:
    """What to install after a failed import; None if no extra of the package would help."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRAS:
        return None
    return InputError("installation", module, error.msg, f"it: pip install 'quasilpv[{EXTRAS[module]}]'")
