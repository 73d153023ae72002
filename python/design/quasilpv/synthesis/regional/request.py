"""What a design of a general system is asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Literal, TypeAlias, get_args

import numpy as np

from quasilpv.documents.system_artifact import PREMISE_FAULT_S
from quasilpv.errors import InputError, one_of
from quasilpv.systems.descriptor.system import DescriptorSystem

Objective: TypeAlias = Literal["largest-region", "fastest", "least-gain", "least-l2-gain"]

DEFAULT_RATE_HZ = 1000.0
OUTPUTS = "outputs"
"""Stands for the states that are outputs, where states are named."""

DEFAULT_SHARE = 0.5
"""Of the half-widths of the domain, that `fastest` and `least-gain` have to cover."""


@dataclass(frozen=True)
class RegionalRequest:
    """A system, and what its controller has to do.

    Attributes:
        system: in deviations from its trim.
        objective: what is best: ``largest-region`` (the largest ellipsoid in which everything holds), ``fastest`` (the
            largest decay rate), ``least-gain`` (the smallest input used in the region), ``least-l2-gain`` (the least
            gain from disturbance to performance).
        decay_rate: alpha with ``V' <= -2 alpha V``, 1/s; not of ``fastest``.
        input_limits: by name, the largest magnitude of an input's deviation from its trim.
        rate_hz: of the sampled loop; None: `DEFAULT_RATE_HZ`, or faster if only that is proved.
        speed: bound of the closed loop in the norm of the region, 1/s; None: whatever results.
        share: of the half-widths of the domain that the region has to cover, but for ``largest-region``.
        disturbance: by name of an input, to which it is added, or of a differential state, to whose rate it is added:
            the size that counts as 1.
        performance: by name of a state or an input, the deviation that counts as 1.
        premise_fault_s: for so long a premise may be outside its box, clamped, before the loop goes into a fault, s; 0:
            at once, None: always.
        measured: names of the differential states that the law reads; the others are estimated. Empty: it reads all;
            ``("outputs",)``: those that are outputs of the system.
        start_estimate: by name of a state that is not measured, its first estimate, with trim; its trim if not named.

    Raises:
        InputError: a number is out of range or a name is unknown.
    """

    system: DescriptorSystem
    objective: Objective = "largest-region"
    decay_rate: float | None = None
    input_limits: Mapping[str, float] = field(default_factory=dict)
    rate_hz: float | None = None
    speed: float | None = None
    share: float = DEFAULT_SHARE
    disturbance: Mapping[str, float] = field(default_factory=dict)
    performance: Mapping[str, float] = field(default_factory=dict)
    premise_fault_s: float | None = PREMISE_FAULT_S
    measured: Sequence[str] = ()
    start_estimate: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what has no meaning."""
        source = self.system.name
        if self.objective not in get_args(Objective):
            raise InputError(source, "objective", self.objective, one_of(get_args(Objective), self.objective))
        for name, bound in self.input_limits.items():
            if name not in self.system.inputs:
                raise InputError(source, "input limit", name, one_of(self.system.inputs, name))
            if not (isfinite(bound) and bound > 0.0):
                raise InputError(source, f"input limit {name}", bound, "a finite number > 0")
        numbers = {"decay": self.decay_rate, "rate": self.rate_hz, "speed": self.speed}
        for name, value in numbers.items():
            if value is not None and not (isfinite(value) and value > 0.0):
                raise InputError(source, name, value, "a finite number > 0")
        if self.premise_fault_s is not None and not 0.0 <= self.premise_fault_s < inf:
            raise InputError(source, "premise fault", self.premise_fault_s, "a finite time >= 0, s")
        if not 0.0 < self.share < 1.0:
            raise InputError(source, "share", self.share, "a number between 0 and 1")
        if not self.system.inputs:
            raise InputError(source, "inputs", "none", "a system with an input: a design is a feedback")
        if self.objective == "least-gain" and not self.input_limits:
            raise InputError(source, "input limit", "none", "one, in units of which least-gain measures the input")
        if self.objective == "fastest" and self.decay_rate is not None:
            raise InputError(source, "decay", self.decay_rate, "none: fastest finds it")

        self._check_performance()
        self._check_measured()

    def _check_measured(self) -> None:
        system, source = self.system, self.system.name
        names = [symbol.name for symbol in system.state[: system.differential]]
        if tuple(self.measured) == (OUTPUTS,) and OUTPUTS not in names:
            object.__setattr__(self, "measured", _shown_states(system))
        algebraic = [symbol.name for symbol in system.state[system.differential :]]
        for name in self.measured:
            if name in algebraic:
                raise InputError(source, "measured", name, "differential states: an algebraic one follows from them")
            if name not in names:
                raise InputError(source, "measured", name, one_of(names, name))
        if len(set(self.measured)) != len(self.measured):
            raise InputError(source, "measured", ", ".join(self.measured), "each name once")
        if self.measured and set(self.measured) == set(names):
            raise InputError(source, "measured", "every differential state", "some of them, or no such option")
        estimated = [name for name in names if name not in self.measured] if self.measured else []
        for name, value in self.start_estimate.items():
            if name not in estimated:
                expected = one_of(estimated, name) if estimated else "none: no state is estimated"
                raise InputError(source, "start estimate", name, expected)
            if not isfinite(value):
                raise InputError(source, f"start estimate {name}", value, "a finite number")
        for premise in system.premises if self.measured else ():
            used = {symbol.name for symbol in premise.expression.free_symbols}
            if used & set(algebraic):
                got = f"{premise.name} = {premise.expression}"
                raise InputError(source, "measured", got, "premises of differential states: the others are estimated")

    def _check_performance(self) -> None:
        source, needs = self.system.name, self.objective == "least-l2-gain"
        names = [symbol.name for symbol in self.system.state]
        known = {
            "disturbance": [*names[: self.system.differential], *self.system.inputs],
            "performance": [*names, *self.system.inputs],
        }
        for member, allowed in known.items():
            given: Mapping[str, float] = getattr(self, member)
            if bool(given) != needs:
                expected = "at least one, by name a size" if needs else "none: only least-l2-gain has one"
                raise InputError(source, member, ", ".join(given) or "none", expected)
            for name, size in given.items():
                if name not in allowed:
                    raise InputError(source, member, name, one_of(allowed, name))
                if not (isfinite(size) and size > 0.0):
                    raise InputError(source, f"{member} {name}", size, "a finite number > 0")

    def sizes(self, named: Mapping[str, float]) -> tuple[float, ...]:
        """Of every state and input, the size under its name; 0 if there is none."""
        return tuple(named.get(name, 0.0) for name in [*(s.name for s in self.system.state), *self.system.inputs])

    @property
    def sample_period_s(self) -> float:
        """T, s."""
        return 1.0 / (self.rate_hz or DEFAULT_RATE_HZ)

    @property
    def unbounded(self) -> str | None:
        """The name of a differential state in whose direction nothing bounds the region; None if something does."""
        if self.speed is not None or all(isfinite(bound) for bound in self.limits_of_inputs):
            return None
        q = self.system.differential
        named = zip(self.system.state[:q], self.bounds_of_states[:q], strict=True)
        return next((symbol.name for symbol, bound in named if not isfinite(bound)), None)

    @property
    def limits_of_inputs(self) -> tuple[float, ...]:
        """In order; infinite where none is stated."""
        return tuple(self.input_limits.get(name, inf) for name in self.system.inputs)

    @property
    def bounds_of_states(self) -> tuple[float, ...]:
        """Largest magnitude of every state that lies in its domain on both sides; infinite where there is no domain.

        Raises:
            InputError: the domain of a state does not hold the trim inside.
        """
        bounds = []
        for symbol in self.system.state:
            low, high = self.system.domain.get(symbol, (-inf, inf))
            bound = min(-float(low), float(high))
            if bound <= 0.0:
                raise InputError(self.system.name, f"domain of {symbol}", (low, high), "the trim inside the interval")
            bounds.append(bound)
        return tuple(bounds)


def _shown_states(system: DescriptorSystem) -> tuple[str, ...]:
    """The names of the states that are outputs of a system, in their order.

    Raises:
        InputError: an output is not a state by itself.
    """
    shown = set()
    for k, row in enumerate(system.C.constant):
        [*places] = np.flatnonzero(row)
        if len(places) != 1 or system.C.coefficients[:, k].any():
            expected = "outputs that are states: name states, or make what is measured one (a change of coordinates)"
            raise InputError(system.name, "measured", f"output {k + 1} of {len(system.C.constant)}", expected)
        shown.add(int(places[0]))
    return tuple(system.state[k].name for k in sorted(shown))
