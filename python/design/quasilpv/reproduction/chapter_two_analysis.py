"""Figure II.3: admissibility of Example II.6 in four representations, and the exact limits."""

from __future__ import annotations

from math import sqrt

from quasilpv.reproduction import rules
from quasilpv.reproduction.grids import axis, grid, limits, nested_figure, sizes
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.studies.boundary import Interval
from quasilpv.studies.question import Question

METHODS = {
    "TS, Theorem I.1": ("I.1", "ts"),
    "Theorem II.5": ("II.5", "per-premise@0"),
    "Corollary 1": ("II.5-cor1", "per-premise@0"),
    "reduced, Theorem I.1": ("I.1", "reduced"),
}

LARGEST = 2.5 + sqrt(6.5)
SMALLEST = 2.5 - sqrt(6.5)
"""Range of (cos x + 5 sin x) sin x = 5/2 + sqrt(26)/2 sin(2 x - phi): ``x_1' = -(1 + a/b (cos + 5 sin) sin) x_1``."""


def _fig_ii3(effort: Effort) -> Finding:
    x = axis("a", -10.0, 10.0, effort, quick=15, full=41)
    y = axis("b", -10.0, 10.0, effort, quick=15, full=41)
    regions = {name: grid(Question("ex-II.6", *method), x, y) for name, method in METHODS.items()}
    ts, five, corollary, reduced = (rules.feasible(region) for region in regions.values())
    checks = [
        rules.strict_inclusion("the reduced representation gives less than Corollary 1", reduced, corollary),
        rules.strict_inclusion("Corollary 1 gives less than Theorem II.5", corollary, five),
        rules.same_region("Theorem II.5 gives as much as TS", five, ts),
    ]
    exact = {"a > 0": -1.0 / SMALLEST, "a < 0": -1.0 / LARGEST}
    ends = {"a > 0": Interval("a", 0.0, 40.0), "a < 0": Interval("a", 0.0, -1.0)}
    asked = {
        f"{name}, {side}": (Question("ex-II.6", *method, (("b", 1.0),)), over)
        for name, method in METHODS.items()
        for side, over in ends.items()
    }
    found = limits(asked, 1e-3)
    sound = all((value or 0.0) / exact[name[-5:]] <= 1.0 for name, value in found.items())
    checks.append(rules.fact("(own) no proved limit exceeds the exact one", sound, f"exact limits of a/b: {exact}"))
    title = "Example II.6, admissible for proved pairs (a, b)"
    return Finding(
        checks,
        {**sizes(regions), "limits of a/b at b > 0": found, "exact limits": exact},
        {"": nested_figure(regions, title, ("a (no unit)", "b (no unit)"))},
        instead="Regions depend on a/b and the sign of b only (scaling of x_2): the grid cannot show the limits, which"
        " are found by bisection",
    )


ITEMS = (
    Item(
        id="fig-II.3",
        title="Example II.6, admissibility in four representations",
        printed={"a": [-10, 10], "b": [-10, 10], "claim": "Dehak 2020 < Corollary 1 < Theorem II.5 = He 2021"},
        assumptions=(
            "He 2021, Theorem 3.3, and Dehak 2020, Theorem 2, are not restated in the source: Theorem I.1 on the TS and"
            " on the reduced representation stand for them",
        ),
        compute=_fig_ii3,
    ),
)
