"""The one door of the checker: documents in, typed artifacts and witnesses out; raw members are read nowhere else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeAlias, TypeVar

from pydantic import ConfigDict

from quasilpv.documents.artifact import ArtifactDocument, LawT
from quasilpv.documents.mechanism import Mechanism
from quasilpv.documents.payloads import PayloadsDocument
from quasilpv.documents.programs import Program
from quasilpv.documents.robot import read_mechanism, read_payloads
from quasilpv.documents.strict_model import StrictModel, validate
from quasilpv.errors import InputError


class WitnessDocument(StrictModel):
    """What a claim needs beside the law; a witness may hold more, for people and for other claims."""

    model_config = ConfigDict(extra="ignore")


Rows: TypeAlias = tuple[tuple[float, ...], ...]
"""A matrix of a witness, of numbers of any size: no run-time side reads it."""

WitnessT = TypeVar("WitnessT", bound=WitnessDocument)
Frame = TypeVar("Frame", bound=ArtifactDocument[Any])


@dataclass(frozen=True, eq=False)
class Shipped(Generic[LawT]):
    """An artifact as the checker sees it.

    Attributes:
        artifact: its members.
        source: what to call it in errors.
    """

    artifact: ArtifactDocument[LawT]
    source: str = "artifact"

    @property
    def law(self) -> LawT:
        """The law."""
        return self.artifact.law

    @cached_property
    def mechanism(self) -> Mechanism:
        """The nominal robot.

        Raises:
            InputError: it is none known here.
        """
        return read_mechanism(self.artifact.robot.parameters, self.artifact.schema_version, self.source)

    @cached_property
    def payloads(self) -> PayloadsDocument:
        """The set of plants.

        Raises:
            InputError: it is not of the form of the robot's kind.
        """
        return read_payloads(self.artifact.payloads, self.mechanism, self.source)

    def require_no_lag(self, expected: str) -> None:
        """Raise InputError if the drives of the set of plants lag."""
        if self.payloads.drive_lag_s[1] > 0.0:
            raise InputError(self.source, "payloads.lag_s", list(self.payloads.drive_lag_s), expected)

    def program(self, name: str) -> Program:
        """One of its programs.

        Raises:
            InputError: it has none of that name.
        """
        if name not in self.artifact.programs:
            raise InputError(self.source, "programs", sorted(self.artifact.programs), f"a program {name}")
        return self.artifact.programs[name]

    def witness(self, model: type[WitnessT]) -> WitnessT:
        """The witness, or that part of it that a claim is about.

        Raises:
            InputError: it is not of the documented form.
        """
        try:
            return validate(model, self.artifact.witness or {}, self.source)
        except InputError as error:
            raise InputError(self.source, f"witness.{error.field}", error.got, error.expected) from error


def read_artifact_document(
    frame: type[Frame], document: Mapping[str, object], source: str, tags: tuple[str, ...]
) -> Frame:
    """An artifact from its JSON tree; its hash is not looked at.

    Args:
        frame: with the law kinds that are known.
        document: the tree.
        source: what to call it in errors.
        tags: names of the kinds, which are no members.

    Raises:
        InputError: a member is not of the documented form.
    """
    return validate(frame, {key: value for key, value in document.items() if key != "hash"}, source, tags=tags)
