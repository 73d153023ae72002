"""The checker of artifacts of general systems: every claim from the artifact alone, with what the verdict rests on."""

from __future__ import annotations

import time

from quasilpv.certificate.exact.claims import Verification
from quasilpv.certificate.systems.linearised import LinearisedLoop
from quasilpv.certificate.systems.regional import regional_claims
from quasilpv.certificate.systems.sampled import SampledLoop
from quasilpv.documents.strict_model import FieldError
from quasilpv.documents.system_artifact import LinearisedSampling, SystemArtifactDocument
from quasilpv.errors import InputError

__all__ = ["verify_system"]


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
            loop = LinearisedLoop if isinstance(artifact.sampling, LinearisedSampling) else SampledLoop
            claims = (*claims, loop(artifact).claim(artifact.sample_period_s))
    except FieldError as error:
        raise InputError(source, error.field, error.got, error.expected) from error
    except (LookupError, TypeError, ValueError, ArithmeticError) as error:
        raise InputError(source, "witness", f"{type(error).__name__}: {error}", "what its claims need") from error
    return Verification(claims, time.perf_counter() - start)
