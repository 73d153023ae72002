"""The artifact: everything the run-time side and an independent checker need to know of one controller.

The members, their units and the meaning of each law kind are in ``docs/reference/formats.md``; the classes of
`quasilpv.documents` are that table, and here its members are checked against each other. Numbers are SI, angles rad,
index 0 is the first joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

from pydantic import model_validator

from quasilpv.certificate.laws.registry import TAGS, Law
from quasilpv.documents.artifact import ArtifactDocument
from quasilpv.documents.law import PROGRAM_INPUTS
from quasilpv.documents.strict_model import FieldError, validate
from quasilpv.documents.tables import PolytopeTable, require_size
from quasilpv.shown import html_table


class Artifact(ArtifactDocument[Law]):
    """One controller, immutable and consistent: a constructed artifact satisfies every rule of the format.

    >>> import quasilpv as ql
    >>> artifact = ql.design("arm3", law="ctc").release()
    >>> isinstance(artifact, ql.Artifact), artifact.name
    (True, 'arm3-ctc-1000hz')
    """

    def __repr__(self) -> str:
        """What it is, in a few lines; `content` has all of it."""
        rate = f"{1.0 / self.sample_period_s:g} Hz"
        stated = "nothing" if self.verification is None else ", ".join(self.verification)
        lines = [
            f"Artifact({self.name!r}, {self.law.kind} for {self.robot.id!r}, {self.joints} joints, {rate}",
            f"  hash={self.hash}",
            f"  verification={stated})",
        ]
        return "\n".join(lines)

    def __str__(self) -> str:
        """The same."""
        return repr(self)

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks."""
        rows = {
            "law": self.law.kind,
            "robot": f"{self.robot.id}, {self.joints} joints",
            "rate, Hz": f"{1.0 / self.sample_period_s:g}",
            "verification": "nothing" if self.verification is None else ", ".join(self.verification),
            "hash": self.hash,
        }
        return html_table(self.name, rows)

    @classmethod
    def from_document(cls, document: Mapping[str, object], source: str = "artifact") -> Artifact:
        """Return the artifact of a JSON tree; a member ``hash`` is ignored (``canonical.parse_document`` checks it).

        Raises:
            InputError: a rule of the format is broken; the message names the field.
        """
        content = {key: value for key, value in document.items() if key != "hash"}
        return validate(cls, content, source, tags=TAGS)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        n = self.joints
        for field in ("domain.angle_rad", "domain.speed_rad_s", "limits.torque_nm", "limits.slew_nm_per_s"):
            section, member = field.split(".")
            require_size(field, getattr(getattr(self, section), member), n)
        if isinstance(self.law.inertia, PolytopeTable):
            self.law.inertia.require_inertia("law.inertia", n)
        elif self.law.inertia.joints != n:
            raise FieldError("law.inertia.joints", f"{self.law.inertia.joints} entries", str(n))
        self.law.check(n)
        self._check_programs()
        return self

    def _check_programs(self) -> None:
        required = self.law.programs
        if set(self.programs) != set(required):
            raise FieldError("programs", sorted(self.programs), f"{sorted(required)} for kind {self.law.kind}")
        for name in required:
            program = self.programs[name]
            premises = self.law.premises_of(name)
            outputs = self.joints if premises is None else premises
            if program.outputs != outputs:
                raise FieldError(f"programs.{name}.outputs", program.outputs, str(outputs))
            field, allowed = f"programs.{name}.code", PROGRAM_INPUTS[name]
            for variable, highest in program.inputs().items():
                if variable not in allowed:
                    raise FieldError(field, variable, f"only {', '.join(allowed)} as inputs")
                if highest >= self.joints:
                    raise FieldError(field, f"{variable} {highest}", f"joint indices below {self.joints}")
