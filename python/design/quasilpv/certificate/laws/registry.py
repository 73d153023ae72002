"""The law kinds: each stands in a file of this folder, and here in two lines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Field

from quasilpv.certificate.laws import (
    ctc,
    delayed_feedback,
    descriptor_feedback,
    dob_acceleration,
    dob_torque,
    hinf_tracking,
    link_damped,
    motor_pid,
    pid,
    state_feedback,
)
from quasilpv.certificate.laws.kind import LawKind
from quasilpv.documents.design_inertia import DESIGN_INERTIA_TAGS
from quasilpv.documents.law import LawDocument

LAWS: Mapping[str, LawKind] = {
    law.name: law
    for law in (
        dob_acceleration.LAW,
        dob_torque.LAW,
        hinf_tracking.LAW,
        state_feedback.LAW,
        descriptor_feedback.LAW,
        delayed_feedback.LAW,
        link_damped.LAW,
        motor_pid.LAW,
        pid.LAW,
        ctc.LAW,
        ctc.LAW_WITH_OBSERVER,
    )
}
"""By their tags."""

TAGS = (*LAWS, *DESIGN_INERTIA_TAGS)
"""Names of cases of unions in an artifact, which are no members in paths of errors."""

if TYPE_CHECKING:
    Law = LawDocument
else:
    # Made of the table, so that a kind is listed once; to a type checker any law is a law.
    Law = Annotated[Union[tuple(law.document for law in LAWS.values())], Field(discriminator="kind")]  # noqa: UP007
