"""An independent, small checker: every claim of an artifact, rebuilt from its data and decided in exact arithmetic.

It shares nothing with the rooms that make a design: no LMI vocabulary, no conditions, no solver. It reads the artifact
as a plain document and checks the gains as shipped.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from quasilpv.certificate.claims import Claim, Verification
from quasilpv.certificate.sampled_chains import check_dob_acceleration
from quasilpv.certificate.torque_law import check_dob_torque
from quasilpv.errors import InputError

__all__ = ["CHECKERS", "Claim", "Verification", "verify"]

CHECKERS: Mapping[str, Callable[[Mapping[str, Any]], tuple[Claim, ...]]] = {
    "dob-acceleration": check_dob_acceleration,
    "dob-torque": check_dob_torque,
}
"""How each law kind is checked; kinds without an entry make no claim."""


def verify(document: Mapping[str, Any], source: str = "artifact") -> Verification:
    """Check every claim of an artifact document.

    Args:
        document: the artifact as a JSON tree.
        source: what to call it in errors.

    Raises:
        InputError: the law kind makes no claim, or the witness is missing or malformed.
    """
    start = time.perf_counter()
    kind = document["law"]["kind"]
    if kind not in CHECKERS:
        raise InputError(source, "law.kind", kind, f"one with a certificate: {', '.join(CHECKERS)}")
    try:
        claims = CHECKERS[kind](document)
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        raise InputError(source, "witness", f"{type(error).__name__}: {error}", f"what {kind} needs") from error
    return Verification(claims, time.perf_counter() - start)
