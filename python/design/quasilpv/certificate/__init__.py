"""An independent, small checker: every claim of an artifact, rebuilt from its data and decided, with its evidence.

It shares no LMI vocabulary, no conditions and no solver with the rooms that make a design (the grid gate of
torque-level laws, which proves nothing, uses the loops the design searches with). It reads the artifact as a plain
document and checks the gains as shipped.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from flint import fmpq

from quasilpv.certificate.claims import Claim, Evidence, Verification
from quasilpv.certificate.design_model import check_design_model
from quasilpv.certificate.gate import RobustGate, robust_gate
from quasilpv.certificate.gate_data import HALF_A_SAMPLE, law_kind
from quasilpv.certificate.grid_gate import GridGate, grid_gate
from quasilpv.certificate.hinf_law import check_hinf_tracking
from quasilpv.certificate.sampled_chains import check_dob_acceleration
from quasilpv.certificate.stabilising_laws import (
    check_delayed_feedback,
    check_descriptor_feedback,
    check_state_feedback,
)
from quasilpv.certificate.torque_law import check_dob_torque
from quasilpv.errors import InputError

__all__ = ["CHECKERS", "GATES", "Claim", "Evidence", "Gate", "Verification", "gate", "verify"]

Checker: TypeAlias = Callable[[Mapping[str, Any]], tuple[Claim, ...]]
Gate: TypeAlias = RobustGate | GridGate

CHECKERS: Mapping[str, tuple[Checker, ...]] = {
    "dob-acceleration": (check_dob_acceleration, check_design_model),
    "dob-torque": (check_dob_torque, check_design_model),
    "hinf-tracking": (check_hinf_tracking, check_design_model),
    "state-feedback": (check_state_feedback, check_design_model),
    "descriptor-feedback": (check_descriptor_feedback, check_design_model),
    "delayed-feedback": (check_delayed_feedback, check_design_model),
}
"""How each law kind is checked: its inequalities, then its design model; kinds without an entry make no claim."""

GATES: Mapping[str, Callable[[Mapping[str, Any], str, fmpq], Gate]] = {
    "dob-acceleration": robust_gate,
    "dob-torque": grid_gate,
    "hinf-tracking": grid_gate,
    "state-feedback": grid_gate,
    "descriptor-feedback": grid_gate,
    "delayed-feedback": grid_gate,
}
"""The robust gate of each law kind: a proof where the loop decouples, a grid elsewhere."""


def gate(document: Mapping[str, Any], source: str = "artifact", delay_samples: fmpq = HALF_A_SAMPLE) -> Gate:
    """Put an artifact to the robust gate of its law kind.

    Args:
        document: the artifact as a JSON tree.
        source: what to call it in errors.
        delay_samples: the transport delay it has to tolerate, in samples.

    Raises:
        InputError: the law kind has no gate, or what `robust_gate` or `grid_gate` refuse.
    """
    return GATES[law_kind(document, source, GATES)](document, source, delay_samples)


def verify(document: Mapping[str, Any], source: str = "artifact") -> Verification:
    """Check every claim of an artifact document.

    Args:
        document: the artifact as a JSON tree.
        source: what to call it in errors.

    Raises:
        InputError: the law kind makes no claim, the witness is missing or malformed, or the robot is not known.
    """
    start = time.perf_counter()
    kind = document["law"]["kind"]
    if kind not in CHECKERS:
        raise InputError(source, "law.kind", kind, f"one with a certificate: {', '.join(CHECKERS)}")
    try:
        claims = tuple(claim for check in CHECKERS[kind] for claim in check(document))
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        raise InputError(source, "witness", f"{type(error).__name__}: {error}", f"what {kind} needs") from error
    return Verification(claims, time.perf_counter() - start)
