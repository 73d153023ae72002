"""Figures III.1 and III.3: unknown premises as vertices (Theorem III.9) or norm-bounded uncertainty (I.3)."""

from __future__ import annotations

from quasilpv.reproduction import rules
from quasilpv.reproduction.grids import axis, grid, limits, nested_figure, sizes
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.studies.boundary import Interval
from quasilpv.studies.question import Question

PROXY = (
    "He 2021, Theorem 3.1, is not restated in the source: Theorem I.3 (norm-bounded uncertainty) on TS stands for it"
)

METHODS = {"Theorem III.9": ("III.9", "uncertain@0"), "TS, Theorem I.3": ("I.3", "ts")}


def _fig_iii1(effort: Effort) -> Finding:
    x = axis("a", -14.0, -8.0, effort, quick=7, full=25)
    y = axis("b", -25.0, -15.0, effort, quick=5, full=11)
    box = (("z2_lower", 0.0),)
    regions = {name: grid(Question("ex-III.11", *method, box), x, y) for name, method in METHODS.items()}
    robust, bounded = (rules.feasible(region) for region in regions.values())
    ratio = len(robust) / max(1, len(bounded))
    checks = [
        rules.strict_inclusion("Theorem III.9 gives more than norm-bounded uncertainty", bounded, robust),
        rules.number("size of the region of Theorem III.9 by that of norm-bounded uncertainty", 2.0, ratio),
    ]
    asked = {
        f"{name}, b = {b:g}": (Question("ex-III.11", *method, (*box, ("b", b))), Interval("a", -8.0, -14.0))
        for name, method in METHODS.items()
        for b in ((-25.0,) if effort is Effort.QUICK else (-25.0, -15.0))
    }
    edges = limits(asked, 2e-2 if effort is Effort.QUICK else 2e-3)
    title = "Example III.11 with z2 in [0, 1], stabilised for proved pairs (a, b)"
    return Finding(
        checks,
        {**sizes(regions), "leftmost proved a": edges, "ratio": ratio},
        {"": nested_figure(regions, title, ("a (no unit)", "b (no unit)"))},
        instead=f"Against Theorem I.3 on TS the region grows by a factor {ratio:.2f}, every point proved; a factor of 2"
        " can only hold against a more conservative baseline",
    )


def _fig_iii3(effort: Effort) -> Finding:
    x = axis("M", 0.1, 15.0, effort, quick=5, full=16)
    y = axis("c", 2.0, 20.0, effort, quick=7, full=19)
    regions = {name: grid(Question("ex-III.12", *method), x, y) for name, method in METHODS.items()}
    robust, bounded = (rules.feasible(region) for region in regions.values())
    checks = [rules.strict_inclusion("Theorem III.9 gives more than norm-bounded uncertainty", bounded, robust)]
    masses = (0.1, 1.0, 15.0)
    asked = {
        f"M = {M:g} kg": (Question("ex-III.12", "I.3", "ts", (("M", M),)), Interval("c", 0.1, 60.0)) for M in masses
    }
    asked |= {
        f"Theorem III.9, M = {M:g} kg": (
            Question("ex-III.12", "III.9", parameters=(("M", M),)),
            Interval("c", 0.1, 60.0),
        )
        for M in (0.1, 15.0)
    }
    edges = limits(asked, 5e-3)
    title = "Example III.12, disc with inertia uncertain by delta <= c, stabilised for proved pairs (M, c)"
    return Finding(
        checks,
        {**sizes(regions), "largest proved c": edges},
        {"": nested_figure(regions, title, ("mass M (kg)", "bound c of the uncertainty (1/kg)"))},
        instead="Largest proved c, searched up to 60: "
        + ", ".join(f"{name}: {'none' if c is None else format(c, '.3g')}" for name, c in edges.items()),
    )


ITEMS = (
    Item(
        id="fig-III.1",
        title="Example III.11, stabilisation with an unknown premise",
        printed={"a": [-14, -8], "b": [-25, -15], "claim": "nearly twice the region of He 2021, Theorem 3.1"},
        assumptions=("z2 in [0, 1], as printed in Example III.10 (its true range is [1/2, 1])", PROXY),
        compute=_fig_iii1,
    ),
    Item(
        id="fig-III.3",
        title="Example III.12, spring-disc with uncertain inertia",
        printed={"M_kg": [0.1, 15], "claim": "Theorem III.9 larger"},
        assumptions=(
            "the signs of dA_44 and dB_4, printed wrong, follow from the constraint",
            "|x_1| <= 5 m, and c up to 20 1/kg: neither is stated",
            PROXY,
        ),
        compute=_fig_iii3,
    ),
)
