"""The checker of artifacts of general systems: every claim from the artifact alone, with what the verdict rests on."""

from __future__ import annotations

import time
from typing import TypeAlias

from quasilpv.certificate.exact.claims import Verification
from quasilpv.certificate.systems.linearised import LinearisedLoop
from quasilpv.certificate.systems.observed import ObservedLoop
from quasilpv.certificate.systems.regional import regional_claims
from quasilpv.certificate.systems.sampled import SampledLoop
from quasilpv.documents.strict_model import FieldError
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.errors import InputError

__all__ = ["verify_system"]

_Loop: TypeAlias = SampledLoop | LinearisedLoop | ObservedLoop
_LOOPS: dict[str, type[_Loop]] = {"euler": SampledLoop, "linearised": LinearisedLoop, "observer": ObservedLoop}
"""By how a sampling period is said to be proved, what proves it."""


def verify_system(artifact: SystemArtifactDocument, source: str = "artifact") -> Verification:
    """Check every claim of an artifact of a system.

    Args:
        artifact: as it was read.
        source: what to call it in errors.

    Raises:
        InputError: the witness lacks something, or what is in it does not fit.
    """
    start = time.perf_counter()
    try:
        claims = tuple(regional_claims(artifact))
        if artifact.sampling is not None:
            claims = (*claims, _LOOPS[artifact.sampling.method](artifact).claim(artifact.sample_period_s))
    except FieldError as error:
        raise InputError(source, error.field, error.got, error.expected) from error
    except (LookupError, TypeError, ValueError, ArithmeticError) as error:
        raise InputError(source, "witness", f"{type(error).__name__}: {error}", "what its claims need") from error
    return Verification(claims, time.perf_counter() - start)
