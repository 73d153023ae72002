"""From a system and a request to the artifact that is shipped: designed, compiled, checked, in one object.

For general systems what `quasilpv.release` is for robots. Nothing leaves it whose claims do not hold, or whose sampling
period is not proved, unless that is asked for; then the artifact says so.
"""

from __future__ import annotations

from quasilpv.certificate.systems import verify_system
from quasilpv.documents.system_artifact import SamplingDocument, SystemArtifactDocument
from quasilpv.errors import ClaimError
from quasilpv.progress import Progress, no_progress
from quasilpv.synthesis.regional.request import RegionalRequest
from quasilpv.system_release.document import artifact_of
from quasilpv.system_release.observing import observed
from quasilpv.system_release.search import searched

__all__ = ["release_system"]


def release_system(
    request: RegionalRequest,
    *,
    allow_unproved_rate: bool = False,
    progress: Progress = no_progress,
) -> SystemArtifactDocument:
    """Design a feedback, find its region, check all of it on the numbers that are shipped.

    Designs are tried until the sampling period of one is proved: the one that was asked for, then those with slower
    closed loops and more decay where neither was asked for. If no rate was asked for either, closed loops for some are
    tried, and the rate is the next of 1, 2, 5, 10 ... that is proved.
    A period is proved by Euler's bound, which is cheap, or else by the sharper one. Where states are not measured, an
    observer is designed for the feedback, and the period is proved with it: `quasilpv.system_release.observing`.

    Args:
        request: what is asked for.
        allow_unproved_rate: release a sampling period that is not proved; the artifact says so.
        progress: called with (designs done, designs in all).

    Raises:
        InputError: something does not fit; see `design_feedback`.
        InfeasibleError: no feedback was found.
        ClaimError: a claim does not hold on the shipped numbers, or the sampling period is not proved.
    """
    sampling: SamplingDocument | None
    if request.measured:
        design, own = observed(request, allow_unproved_rate, progress)
        sampling, observer = own.sampling, own.observer
    else:
        found = searched(request, allow_unproved_rate, progress)
        design, sampling, observer = found.design, found.sampling, None
    artifact = artifact_of(design, sampling, observer=observer)
    verdict = verify_system(artifact)
    if not verdict.verified:
        raise ClaimError(f"{artifact.name}: not verified: {', '.join(verdict.failed[:3])}")
    evidence = {"version": 1, "certificate": verdict.findings(), "assumed": list(design.assumed)}
    return artifact_of(design, sampling, evidence, observer)
