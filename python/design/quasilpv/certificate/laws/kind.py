"""What the checker knows of a law kind: one entry, written in the file of the law."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

from flint import fmpq

from quasilpv.certificate.exact.claims import Claim, Evidence
from quasilpv.certificate.gate.elastic import ElasticGate
from quasilpv.certificate.gate.elastic_grid import ElasticGridGate
from quasilpv.certificate.gate.grid import GridGate
from quasilpv.certificate.gate.proof import RobustGate
from quasilpv.certificate.reading import Shipped
from quasilpv.documents.artifact import ArtifactDocument
from quasilpv.documents.law import LawDocument

Gate: TypeAlias = RobustGate | GridGate | ElasticGate | ElasticGridGate


class GateFunction(Protocol):
    """From an artifact and a transport delay in samples to what the robust gate finds."""

    def __call__(self, shipped: Shipped[Any], delay_samples: fmpq) -> Gate:
        """InputError: the artifact does not fit the gate."""


@dataclass(frozen=True)
class LawKind:
    """A law kind.

    Attributes:
        document: its document, with its parameters, its tag and its programs.
        checks: what it claims, decided: its inequalities, then its design model; none for a law that claims nothing.
        gate: its robust gate: a proof where the loop decouples, a grid elsewhere; None for a law without.
        gate_evidence: what the gate of a released artifact has to rest on; a grid is called one.
        covers_lag: whether claims and gate hold for drives that lag, or are about others.
        claims_by_witness: an artifact without a witness claims nothing: what was looked at on a grid is no claim.
    """

    document: type[LawDocument]
    checks: tuple[Callable[[Shipped[Any]], Iterable[Claim]], ...] = ()
    gate: GateFunction | None = None
    gate_evidence: Evidence = Evidence.SAMPLED
    covers_lag: bool = False
    claims_by_witness: bool = False

    def claims_of(self, artifact: ArtifactDocument[Any]) -> bool:
        """Whether an artifact of this kind claims anything."""
        return bool(self.checks) and not (self.claims_by_witness and artifact.witness is None)

    @property
    def name(self) -> str:
        """The tag in documents."""
        return self.document.tag()
