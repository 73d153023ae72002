"""The members ``robot`` and ``payloads`` of an artifact as typed documents, in this version and the one before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from quasilpv.documents.mechanism import MECHANISM_KINDS, Mechanism, MechanismDocument
from quasilpv.documents.payloads import PayloadsDocument
from quasilpv.documents.strict_model import FieldError, StrictModel, validate
from quasilpv.errors import InputError

PARAMETERS = "robot.parameters"

ARTIFACT_VERSION = 2
"""Of the format that is written; since 2 the parameters of a robot are tagged."""


class _Robot(StrictModel):
    parameters: Mechanism


def read_mechanism(
    parameters: Mapping[str, Any], version: int = ARTIFACT_VERSION, source: str = "artifact"
) -> Mechanism:
    """The robot of an artifact.

    Args:
        parameters: its member ``robot.parameters``.
        version: of the artifact's format; before 2 the parameters had no tag. Default: what is written.
        source: what to call the artifact in errors.

    Raises:
        InputError: a kind that is not known here, or parameters that are not those of its kind.
    """
    tagged = {"kind": _kind_before_tags(parameters, source), **parameters} if version < 2 else parameters
    try:
        return validate(_Robot, {"parameters": dict(tagged)}, source, tags=MECHANISM_KINDS).parameters
    except InputError as error:
        raise InputError(source, f"robot.{error.field}", error.got, error.expected) from error


def _kind_before_tags(parameters: Mapping[str, Any], source: str) -> str:
    """The kind of a robot in an artifact of version 1, which three mechanisms were told apart by: the only guess."""
    if {"active", "passive"} <= parameters.keys():
        return "five-bar"
    if "radius_m" in parameters:
        return "spring-disc"
    if not (links := parameters.get("links")):
        expected = "the links of a planar serial arm, active and passive link of a five-bar linkage, or a disc"
        raise InputError(source, f"{PARAMETERS}.links", links, expected)
    return "serial-arm"


def read_payloads(
    payloads: Mapping[str, Any], mechanism: MechanismDocument, source: str = "artifact"
) -> PayloadsDocument:
    """The payload set of an artifact, in the form of its mechanism's kind.

    Raises:
        InputError: another set than that form describes.
    """
    try:
        read = validate(mechanism.PAYLOADS, dict(payloads), source)
        read.require_joints(mechanism.joints)
    except (FieldError, InputError) as error:
        raise InputError(source, f"payloads.{error.field}", error.got, error.expected) from error
    return read
