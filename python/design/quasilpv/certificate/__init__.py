"""An independent, small checker: every claim of an artifact, rebuilt from its data and decided, with its evidence.

It shares no LMI vocabulary, no conditions and no solver with the rooms that make a design, and stands below them, so
that it cannot (the grid gates, which prove nothing, use the loops the design searches with). It
reads artifacts through the typed documents that writers use too: these are forms, and no formula. Four floors, each on
those before: `exact` arithmetic, the `robot`, the `gate` and the `laws`, one file each. It checks the gains as shipped.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, TypeAlias

from flint import fmpq

from quasilpv.certificate.exact.claims import Claim, Evidence, Verification
from quasilpv.certificate.laws.kind import Gate
from quasilpv.certificate.laws.registry import LAWS, TAGS, Law
from quasilpv.certificate.reading import Shipped, read_artifact_document
from quasilpv.documents.artifact import ArtifactDocument
from quasilpv.errors import InputError

__all__ = ["HALF_A_SAMPLE", "LAWS", "Claim", "Evidence", "Gate", "Verification", "gate", "shipped", "verify"]

HALF_A_SAMPLE = fmpq(1, 2)
"""The transport delay a gate asks for if nobody says otherwise."""

Given: TypeAlias = Mapping[str, Any] | ArtifactDocument[Any]


def shipped(document: Given, source: str = "artifact") -> Shipped[Any]:
    """An artifact as the checker sees it, from its JSON tree or as it was read.

    Raises:
        InputError: a member is not of the documented form.
    """
    if not isinstance(document, ArtifactDocument):
        document = read_artifact_document(ArtifactDocument[Law], document, source, TAGS)
    return Shipped(document, source)


def gate(document: Given, source: str = "artifact", delay_samples: fmpq = HALF_A_SAMPLE) -> Gate:
    """Put an artifact to the robust gate of its law kind.

    Args:
        document: the artifact, or its JSON tree.
        source: what to call it in errors.
        delay_samples: the transport delay it has to tolerate, in samples.

    Raises:
        InputError: the law kind has no gate, or none for drives that lag, or the artifact does not fit it.
    """
    own = shipped(document, source)
    found = LAWS[own.law.kind].gate
    if found is None:
        raise _without(own, "gate", "one with this gate")
    _require_lag_covered(own)
    return found(own, delay_samples)


def verify(document: Given, source: str = "artifact") -> Verification:
    """Check every claim of an artifact.

    Args:
        document: the artifact, or its JSON tree.
        source: what to call it in errors.

    Raises:
        InputError: the law kind makes no claim, the witness is missing or malformed, or the robot is not known.
    """
    start = time.perf_counter()
    own = shipped(document, source)
    checks = LAWS[own.law.kind].checks
    if not checks:
        raise _without(own, "checks", "one with a certificate")
    _require_witness(own)
    _require_lag_covered(own)
    try:
        found = tuple(claim for check in checks for claim in check(own))
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        raise InputError(source, "witness", f"{type(error).__name__}: {error}", f"what {own.law.kind} needs") from error
    return Verification(found, time.perf_counter() - start)


def _require_witness(own: Shipped[Any]) -> None:
    if not LAWS[own.law.kind].claims_of(own.artifact):
        expected = f"one: without it {own.law.kind} claims nothing, its loops were looked at on a grid (gridded)"
        raise InputError(own.source, "witness", "none", expected)


def _require_lag_covered(own: Shipped[Any]) -> None:
    kind = LAWS[own.law.kind]
    if not kind.covers_lag:
        known = ", ".join(law.name for law in LAWS.values() if law.covers_lag)
        own.require_no_lag(
            f"no member of this name: of drives that lag, {kind.name} claims nothing (covered by {known})"
        )


def _without(own: Shipped[Any], part: str, expected: str) -> InputError:
    """The refusal of a law kind without claims or gate; it names those that have."""
    kinds = ", ".join(law.name for law in LAWS.values() if getattr(law, part))
    return InputError(own.source, "law.kind", own.law.kind, f"{expected}: {kinds}")
