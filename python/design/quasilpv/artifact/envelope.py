"""The operating envelope of an artifact as people and figures need it; what is proved of it is for `certificate`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.artifact.schema import Artifact


@dataclass(frozen=True, eq=False)
class EnvelopeSet:
    """An ellipsoid ``x' X^-1 x <= scale^2`` of errors, as seen through the angle and the speed of each joint.

    Attributes:
        covariance: (n, 2, 2), the blocks of X for (angle error, speed error) of each joint: at scale 1 the pair of
            joint j lies in ``p' covariance_j^-1 p <= 1``.
        angle_bound_rad: (n,), largest angle error at scale 1.
        scale: (n,), level or peak per joint in the artifact; None if it states none.
    """

    covariance: FloatArray
    angle_bound_rad: FloatArray
    scale: FloatArray | None

    def border(self, joint: int, scale: float, points: int = 181) -> FloatArray:
        """Border of the set of one joint in the plane of (angle error, speed error), (points, 2), rad and rad/s."""
        phase = np.linspace(0.0, 2.0 * np.pi, points)
        root = np.linalg.cholesky(self.covariance[joint])
        return np.asarray(scale * np.column_stack([np.cos(phase), np.sin(phase)]) @ root.T)

    def largest_scale(self, margin_rad: FloatArray) -> FloatArray:
        """The scale, per joint, at which the set reaches a margin: any reference can be compared with the envelope."""
        return np.asarray(margin_rad / self.angle_bound_rad)


@dataclass(frozen=True, eq=False)
class OperatingEnvelope:
    """What an artifact says of its envelope.

    Attributes:
        angle_rad: (n, 2), operating domain.
        reference_margin_rad: (n,), stated distance of a reference to its border.
        box: errors from which the angles stay in the domain.
        torque: errors from which the correction takes a stated share of the torque limits.
        peak: what a disturbance of unit peak can reach from zero error.
        peak_unit: of that disturbance.
    """

    angle_rad: FloatArray
    reference_margin_rad: FloatArray
    box: EnvelopeSet
    torque: EnvelopeSet
    peak: EnvelopeSet
    peak_unit: str

    @classmethod
    def of(cls, artifact: Artifact) -> OperatingEnvelope | None:
        """The envelope in the witness of an artifact; None if it has none."""
        member = (artifact.witness or {}).get("envelope")
        if not isinstance(member, Mapping):
            return None
        n = artifact.joints
        sampled = member["condition"] == "sampled-envelope"
        peak, unit = ("disturbance_set", "rad/s⁴") if sampled else ("residual_set", "N m")
        return cls(
            angle_rad=np.array(artifact.domain.angle_rad),
            reference_margin_rad=np.array(member["reference_margin_rad"]),
            box=_set_of(member["box_set"], n),
            torque=_set_of(member["torque_set"], n),
            peak=_set_of(member[peak], n),
            peak_unit=unit,
        )


def _set_of(member: Mapping[str, Any], joints: int) -> EnvelopeSet:
    X = np.linalg.inv(np.array(member["P"])) if "P" in member else np.array(member["X"])
    if len(X) == 3 * joints and not np.isscalar(member["bounds"]["angle_rad"]):
        pairs = np.array([X[np.ix_([j, joints + j], [j, joints + j])] for j in range(joints)])
    else:  # one joint's set, the same for all
        pairs = np.tile(X[:2, :2], (joints, 1, 1))
    scale = member.get("level", member.get("peak"))
    return EnvelopeSet(
        covariance=pairs,
        angle_bound_rad=np.broadcast_to(np.array(member["bounds"]["angle_rad"]), joints),
        scale=None if scale is None else np.broadcast_to(np.array(scale), joints),
    )


def envelope_summary(artifact: Artifact) -> dict[str, Any] | None:
    """The envelope without its matrices, as ``design inspect`` prints it; None if there is none."""
    member = (artifact.witness or {}).get("envelope")
    if not isinstance(member, Mapping):
        return None
    matrices = {"P", "X", "Q", "F"}
    return {
        name: {key: value for key, value in part.items() if key not in matrices} if isinstance(part, Mapping) else part
        for name, part in member.items()
    }
