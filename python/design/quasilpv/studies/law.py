"""A law, or an observer, as an answer hands it over: data that can be stored, sent and evaluated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.conditions.condition import Feedback
from quasilpv.conditions.gains import DelayedFeedback, DescriptorGain, Gain, MemorylessGain, ObserverGain
from quasilpv.errors import InputError
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise, PremiseKind
from quasilpv.systems.descriptor.system import DescriptorSystem


@dataclass(frozen=True, eq=False, repr=False)
class Law:
    """What a solution of a condition gives, for one system in the units its author chose.

    >>> import quasilpv as ql
    >>> law = ql.solve("ex-I.1", "II.6", parameters={"b": 2.5}).law
    >>> law.gain([0.0, 0.0, 0.0]).shape  # u = K(z) x at one premise vector
    (1, 2)

    Attributes:
        system: its name.
        condition: the id of the condition.
        state, inputs, outputs: names, and the number of outputs.
        premises: z_1 ... z_r, with expressions and bounds.
        lyapunov: P with ``V = x_d' P^-1 x_d`` (of the estimation error, of an observer), (q, q).
        form: the gain as an object of arrays, see `quasilpv.conditions.gains`.
        delayed: the law with memory, of the conditions that design one; `gain` is then the one without that follows.
    """

    system: str
    condition: str
    state: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: int
    premises: tuple[Premise, ...]
    lyapunov: FloatArray
    form: Gain
    delayed: DelayedFeedback | None = None

    @classmethod
    def of(cls, system: DescriptorSystem, condition: str, feedback: Feedback) -> Law | None:
        """The law of a solution; None for a condition that only analyses."""
        form: Gain | None = feedback.gain or feedback.observer
        if form is None:
            return None
        return cls(
            system=system.name,
            condition=condition,
            state=tuple(symbol.name for symbol in system.state),
            inputs=system.inputs,
            outputs=system.C.shape[0],
            premises=system.premises,
            lyapunov=feedback.lyapunov,
            form=form,
            delayed=feedback.delayed,
        )

    def gain(self, z: Sequence[float] | FloatArray | Mapping[str, float]) -> FloatArray:
        """K(z), (m, n), of ``u = K(z) x``; ``(m, n + q)`` of ``u = K(z) (x_d, x_d', x_a)`` (I.53); L(z) of an observer.

        Args:
            z: the premises in order, or by name; those the law does not know may be left out by name.

        Raises:
            InputError: there are not as many, one is missing, or one is not finite.
        """
        return self.form(self._vector(z))

    @property
    def vertices(self) -> FloatArray:
        """The gains of the vertices of its polytope, the last two axes those of a matrix; see `form`."""
        return self.form.vertices

    @property
    def E(self) -> AffineMatrix | None:
        """The descriptor matrix, if the law multiplies with its inverse."""
        if isinstance(self.form, DescriptorGain):
            return self.form.E
        return self.form.delayed.E if isinstance(self.form, MemorylessGain) else None

    def __repr__(self) -> str:
        """In a few lines."""
        observer = isinstance(self.form, ObserverGain)
        law = "x^ from y" if observer else f"{', '.join(self.inputs)} from {', '.join(self.state)}"
        names = ", ".join(p.name for p in self.premises if p.kind is not PremiseKind.UNKNOWN)
        shape = " x ".join(str(size) for size in self.vertices.shape)
        kind = f"{type(self.form).__name__}, vertices {shape}"
        return f"{self.system}, {self.condition}: {law}\nscheduled with {names or 'nothing'}\n{kind}"

    def _vector(self, z: Sequence[float] | FloatArray | Mapping[str, float]) -> FloatArray:
        if isinstance(z, Mapping):
            unknown = set(z) - {premise.name for premise in self.premises}
            if unknown:
                known = ", ".join(premise.name for premise in self.premises)
                raise InputError("law", "z", ", ".join(sorted(unknown)), f"names among {known}")
            z = [z.get(p.name, p.lower if p.kind is PremiseKind.UNKNOWN else float("nan")) for p in self.premises]
        values = np.asarray(z, dtype=float)
        if values.shape != (len(self.premises),) or not np.isfinite(values).all():
            raise InputError("law", "z", values.tolist(), f"{len(self.premises)} finite numbers")
        return values
