"""What is known about a question, with how sure, in words and as data."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from quasilpv.conditions.reliance import Reliance, Relied, Status
from quasilpv.polytopes.units import Units
from quasilpv.shown import html_table
from quasilpv.studies.law import Law
from quasilpv.studies.refutation import Refutation


class Verdict(StrEnum):
    """Whether a solution exists. `UNKNOWN` is no weak form of the others: nothing was found out.

    >>> import quasilpv as ql
    >>> ql.solve("ex-I.1", "II.6", parameters={"b": 2.5}).verdict is ql.Verdict.FEASIBLE
    True
    """

    FEASIBLE = "feasible"
    INFEASIBLE = "infeasible"
    UNKNOWN = "unknown"


class Evidence(StrEnum):
    """What a verdict rests on.

    >>> import quasilpv as ql
    >>> [str(kind) for kind in ql.Evidence]
    ['proved', 'numerical']
    """

    PROVED = "proved"
    """Exact arithmetic: a solution that was checked, or a mode that refutes all of them."""
    NUMERICAL = "numerical"
    """A solver in double arithmetic found none, in all units that were tried. Not a proof."""


@dataclass(frozen=True, repr=False)
class Answer:
    """What is known about a question.

    >>> import quasilpv as ql
    >>> answer = ql.solve("ex-I.1", "II.6", parameters={"b": 2.5})
    >>> answer.headline, answer.reason
    ('feasible, proved', 'a solution satisfies every inequality, in exact arithmetic')

    Attributes:
        verdict: feasible, infeasible or unknown. A feasible one is always proved.
        evidence: what it rests on; None of an unknown one.
        reason: one sentence.
        margin: of a feasible problem, see `quasilpv.lmi.feasibility.Decision`, in the units it was solved in; None
            otherwise.
        unknowns, rows: scalar unknowns and rows (summed sizes) of the inequalities as solved.
        seconds: wall time, building included.
        refutation: of what is infeasible and proved to be.
        units: powers of two in which the solution was found; None for those of the system. It is one of the system
            in both (`quasilpv.polytopes.units`).
        witness: the kept unknowns at which every inequality was proved, in these units, for `Sweep.proves`; empty if
            there is no such proof.
        relies_on: what a solution is worth nothing without, each proved, refuted or assumed; empty if it was not asked
            for.
        factoring: the premises of the system a solution is for, as text, if that is another factoring of A(x) x; empty
            if it is the one asked about.
        law: of a solution, if it was asked for and the condition gives one.
    """

    verdict: Verdict
    evidence: Evidence | None
    reason: str
    margin: float | None
    unknowns: int
    rows: int
    seconds: float
    refutation: Refutation | None = None
    units: Units | None = None
    witness: tuple[float, ...] = ()
    relies_on: tuple[Relied, ...] = ()
    factoring: str = ""
    law: Law | None = None

    @property
    def certified(self) -> bool:
        """Feasible, and proved in exact arithmetic."""
        return self.verdict is Verdict.FEASIBLE and self.evidence is Evidence.PROVED

    @property
    def headline(self) -> str:
        """Verdict and evidence: *feasible, proved*; *infeasible, proved*; *infeasible, numerically*; *unknown*."""
        words = {Evidence.PROVED: ", proved", Evidence.NUMERICAL: ", numerically", None: ""}
        return f"{self.verdict.value}{words[self.evidence]}"

    def __repr__(self) -> str:
        """In a few lines."""
        lines = [f"{self.headline}: {self.reason}"]
        assumed = [f"{one.name} ({one.detail})" for one in self.relies_on if one.status is Status.ASSUMED]
        if self.verdict is Verdict.FEASIBLE and assumed:
            lines.append(f"assumed: {'; '.join(assumed)}")
        if self.law is not None:
            lines.append(f"law: {self.law!r}".replace("\n", "\n     "))
        return "\n".join([*lines, f"{self.unknowns} unknowns, {self.rows} rows, {self.seconds:.3f} s"])

    def _repr_html_(self) -> str:
        """A table, for notebooks."""
        rows: dict[str, object] = {"because": self.reason}
        if self.law is not None:
            rows["law"] = f"{self.law.condition} for {self.law.system}: {', '.join(self.law.inputs)}"
        rows |= {"unknowns": self.unknowns, "rows": self.rows, "time, s": f"{self.seconds:.3f}"}
        return html_table(self.headline, rows)

    def to_document(self) -> dict[str, Any]:
        """JSON-able, without the law."""
        refutation = None if self.refutation is None else self.refutation.to_document()
        return {
            "verdict": self.verdict.value,
            "evidence": None if self.evidence is None else self.evidence.value,
            "reason": self.reason,
            "margin": self.margin,
            "unknowns": self.unknowns,
            "rows": self.rows,
            "seconds": self.seconds,
            "refutation": refutation,
            "units": None if self.units is None else asdict(self.units),
            "witness": list(self.witness),
            "relies_on": [reliance_document(one) for one in self.relies_on],
            "factoring": self.factoring,
        }

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Answer:
        """What `to_document` wrote; KeyError, TypeError or ValueError if it is something else."""
        evidence, refuted, units = document["evidence"], document["refutation"], document["units"]
        return cls(
            **{
                **document,
                "verdict": Verdict(document["verdict"]),
                "evidence": None if evidence is None else Evidence(evidence),
                "refutation": None if refuted is None else Refutation.from_document(refuted),
                "units": None if units is None else _units(units),
                "witness": tuple(map(float, document["witness"])),
                "relies_on": tuple(map(_relied, document["relies_on"])),
            }
        )


def reliance_document(one: Relied) -> dict[str, str]:
    """JSON-able: name, status and detail of something relied on."""
    return {"name": one.name, "status": one.status.value, "detail": one.detail}


def _relied(document: dict[str, str]) -> Relied:
    return Relied(Reliance(document["name"]), Status(document["status"]), document["detail"])


def _units(document: dict[str, Any]) -> Units:
    exponents = {name: tuple(document[name]) for name in ("state", "inputs", "outputs", "rows")}
    return Units(**exponents, time=document["time"], differential=document["differential"])
