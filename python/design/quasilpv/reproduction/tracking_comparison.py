"""Controllers that the source compares on one path: their runs, and the figures and the table it shows of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeAlias

from quasilpv.figures.side_by_side import disturbance_estimates, input_columns, speed_errors, tracking_columns
from quasilpv.reproduction import tracking_claims
from quasilpv.reproduction.closed_loops import ClosedLoop, Observer, Outcome, PlantName, described, outcome, results
from quasilpv.reproduction.item import Check, Finding, Item
from quasilpv.reproduction.tracking_claims import RATE_HZ, Printed

Finder: TypeAlias = Callable[[], Finding]
"""Makes the finding of an item."""

SHOWN_JOINT = 2
"""Index of the joint whose disturbance is drawn."""


@dataclass(frozen=True)
class Sampled:
    """A controller at a sample rate.

    Attributes:
        controller: its id.
        rate_hz: sample rate.
        slew_scale: see `quasilpv.reproduction.closed_loops.ClosedLoop`.
    """

    controller: str
    rate_hz: float = RATE_HZ
    slew_scale: float = 1.0


@dataclass(frozen=True)
class Comparison:
    """Controllers on one path.

    Attributes:
        name: robot and path, in the titles of items.
        title: the same with plant and rate, in those of figures.
        scenario: its id.
        law: label of the law of the source, which is claimed to be the best.
        controllers: by label, in the order of the source.
        printed: a column of the source's table each.
        assumptions: what the source leaves out of the comparison.
        beside: by label, what the source does not show and the comparison needs.
        plant: see `quasilpv.reproduction.closed_loops`.
        reason: why the numbers are what they are.
    """

    name: str
    title: str
    scenario: str
    law: str
    controllers: Mapping[str, Sampled]
    printed: Mapping[str, Printed]
    assumptions: tuple[str, ...]
    beside: Mapping[str, Sampled] = field(default_factory=dict)
    plant: PlantName = "perturbed"
    reason: str = ""

    def run(self, label: str, observer: Observer = "whole") -> Outcome:
        """The closed loop of one controller, of those compared or beside them."""
        sampled = {**self.controllers, **self.beside}[label]
        return outcome(
            ClosedLoop(
                self.scenario,
                sampled.controller,
                sampled.rate_hz,
                self.plant,
                observer=observer,
                slew_scale=sampled.slew_scale,
            )
        )

    @property
    def others(self) -> tuple[str, ...]:
        """Labels of the controllers that the law is compared with."""
        return tuple(label for label in self.controllers if label != self.law)

    @property
    def loops(self) -> dict[str, Outcome]:
        """The closed loops of the source."""
        return {label: self.run(label) for label in self.controllers}

    @property
    def loops_beside(self) -> dict[str, Outcome]:
        """Those it does not show."""
        return {label: self.run(label) for label in self.beside}

    @property
    def numbers(self) -> str:
        """Why, and the errors of all, in one sentence."""
        return f"{self.reason}RMS X / Y (mm): {tracking_claims.rms_listed({**self.loops, **self.loops_beside})}"

    def item(
        self, item_id: str, what: str, printed: Mapping[str, Any], assumptions: tuple[str, ...], find: Finder
    ) -> Item:
        """An item of the source about these controllers; its effort is that of the runs, which is always the same."""
        return Item(item_id, f"{self.name}: {what}", printed, assumptions, compute=lambda _: find())

    def tracking_item(self, item_id: str, observers: Sequence[str] = ()) -> Item:
        """The figure of paths and errors.

        Args:
            item_id: of the item.
            observers: labels of the controllers whose disturbance estimates are drawn as well.
        """
        claim = {"claim": f"{self.law} tracks best", **self.printed[self.law].as_dict()}
        what = f"tracking with {self.law}, PID and computed torque"
        return self.item(item_id, what, claim, self.assumptions, partial(self._tracking, observers))

    def inputs_finding(self, checks: Sequence[Check], instead: str = "") -> Finding:
        """The figure of torques and speed errors, with the checks of its item."""
        loops = self.loops
        return Finding(checks, described(loops), {"": input_columns(results(loops), self.title)}, instead=instead)

    @property
    def with_and_without(self) -> dict[str, Outcome]:
        """The closed loop of the law, with the disturbance in its observer and without."""
        return {"with": self.run(self.law), "without": self.run(self.law, "without disturbance")}

    def estimates_finding(self, checks: Sequence[Check] = (), instead: str = "") -> Finding:
        """The figure of the law's speed estimates `with_and_without`; its own check and those of its item."""
        observing, without = self.with_and_without.values()
        title = f"{self.title}, {self.law}: error of estimated speeds"
        return Finding(
            [tracking_claims.better_estimates(observing, without), *checks],
            described(self.with_and_without),
            {"": speed_errors(without.result, observing.result, title)},
            instead=instead,
        )

    def _tracking(self, observers: Sequence[str]) -> Finding:
        loops = self.loops
        checks = [
            *tracking_claims.better(loops, self.law, self.others),
            tracking_claims.as_accurate(loops, self.law, self.printed[self.law]),
        ]
        figures = {"": tracking_columns(results(loops), self.title)}
        if observers:
            title = f"{self.title}: disturbance and its estimate{'s' if len(observers) > 1 else ''}"
            estimating = {label: loops[label].result for label in observers}
            figures["disturbance"] = disturbance_estimates(estimating, SHOWN_JOINT, title)
        return Finding(checks, described({**loops, **self.loops_beside}), figures, instead=self.numbers)
