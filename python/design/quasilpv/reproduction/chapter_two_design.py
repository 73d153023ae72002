"""Figures II.4 and II.5: a singular system and the 3-DoF arm, per-premise against TS representation."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from quasilpv.conditions.condition import Options
from quasilpv.reproduction import rules
from quasilpv.reproduction.grids import axis, grid, limits, nested_figure, sizes
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.studies.answer import Verdict
from quasilpv.studies.boundary import Interval
from quasilpv.studies.question import Question
from quasilpv.studies.region import Axis, Region
from quasilpv.studies.sweep import Sweep

PROXIES = (
    "the theorems of He 2021, Zhang 2017, Bouarar 2010 and Dehak 2020 are not restated in the source: Theorem I.2 on"
    " the TS and on the reduced representation, and TS-Pj, stand for what TS modelling reaches"
)

COMMON = Options(common=True)

MASSES_KG = {Effort.QUICK: (1.0, 4.2, 9.0), Effort.FULL: (1.0, 2.0, 3.0, 4.2, 5.0, 6.0, 7.5, 9.0, 12.0, 15.0)}

EXTREMES = (
    {"m3": 15.0, "theta_max": pi, "speed_max": 1000.0},
    {"m3": 0.001, "theta_max": pi, "speed_max": 1000.0},
    {"m3": 15.0, "theta_max": 2.0 * pi, "speed_max": 0.001},
)
"""Domains nobody needs; heavier arms over more turns take more cells than a proof of invertibility may have."""


def _ex_ii7(condition: str, representation: str, effort: Effort) -> Region:
    x = axis("a", -13.0, -8.0, effort, quick=5, full=21)
    y = axis("b", -27.0, -20.0, effort, quick=4, full=15)
    return grid(Question("ex-II.7", condition, representation, (("z2_lower", 0.0),)), x, y)


def _fig_ii4(effort: Effort) -> Finding:
    regions = {
        "TS-Pj": _ex_ii7("TS-Pj", "ts", effort),
        "TS, Theorem I.2": _ex_ii7("I.2", "ts", effort),
        "Theorem II.5": _ex_ii7("II.5", "per-premise@0", effort),
        "Corollary 1": _ex_ii7("II.5-cor1", "per-premise@0", effort),
    }
    places = {name: rules.feasible(region) for name, region in regions.items()}
    five = places["Theorem II.5"]
    edges = _leftmost(effort)
    short = max(1.0 - edges[f"Theorem II.5, b = {b:g}"] / edges[f"TS-Pj, b = {b:g}"] for b in EDGES[effort])
    checks = [
        rules.fact(
            "Corollary 1 is feasible nowhere", not places["Corollary 1"], f"{len(places['Corollary 1'])} points"
        ),
        rules.strict_inclusion("Theorem II.5 gives more than Corollary 1", places["Corollary 1"], five),
        rules.strict_inclusion("Theorem II.5 gives more than TS (Theorem I.2)", places["TS, Theorem I.2"], five),
        rules.same_region("(own) TS with lower blocks per vertex (TS-Pj) gives as much", places["TS-Pj"], five),
    ]
    corners = {name: _corners(*method) for name, method in STATED_BOX.items()}
    numbers = {**sizes(regions), "leftmost proved a at b": edges, "feasible corners for z2 in [1/2, 1]": corners}
    title = "Example II.7 with z2 in [0, 1], stabilised for proved pairs (a, b)"
    return Finding(
        checks,
        numbers,
        {"": nested_figure(regions, title, ("a (no unit)", "b (no unit)"))},
        instead="Leftmost proved a: "
        + "; ".join(f"{name}: {a:.4g}" for name, a in edges.items())
        + f". Theorem II.5 is {short:.1%} short of TS-Pj. With the stated range z2 in [1/2, 1] nothing would be seen:"
        f" TS (Theorem I.2) proves {corners['TS, Theorem I.2']} and Theorem II.5 {corners['Theorem II.5']} of the 4"
        " corners of the map",
    )


EDGES = {Effort.QUICK: (-27.0,), Effort.FULL: (-27.0, -20.0)}
"""Lines of constant b along which the edges of the regions are found."""

STATED_BOX = {"TS, Theorem I.2": ("I.2", "ts"), "Theorem II.5": ("II.5", "per-premise@0")}


def _corners(condition: str, representation: str) -> int:
    question = Question("ex-II.7", condition, representation)
    corners = grid(question, Axis("a", -13.0, -8.0, 2), Axis("b", -27.0, -20.0, 2))
    return len(rules.feasible(corners))


def _leftmost(effort: Effort) -> dict[str, float]:
    """Leftmost proved a by condition and b."""
    five = Question("ex-II.7", "II.5")
    questions = {
        "TS-Pj": Question("ex-II.7", "TS-Pj", "ts"),
        "TS, Theorem I.2": Question("ex-II.7", "I.2", "ts"),
        "Theorem II.5": five,
        "Theorem II.5, L, R, W, Z without index": replace(five, options=COMMON),
    }
    asked = {
        f"{name}, b = {b:g}": (question.at({"b": b, "z2_lower": 0.0}), Interval("a", -8.0, -14.0))
        for name, question in questions.items()
        for b in EDGES[effort]
    }
    found = limits(asked, 4e-3 if effort is Effort.QUICK else 1e-3)
    return {name: -8.0 if a is None else a for name, a in found.items()}


def _fig_ii5(effort: Effort) -> Finding:
    x = axis("m3", 1.0, 15.0, effort, quick=8, full=15)
    y = axis("theta_max", pi / 8, pi, effort, quick=8, full=16)
    regions = {
        "Theorem II.6": grid(Question("ex-II.8", "II.6"), x, y),
        "TS, Theorem I.2": grid(Question("ex-II.8", "tanaka-wang"), x, y),
    }
    whole = len(rules.feasible(regions["Theorem II.6"]))
    total = len(regions["Theorem II.6"].points)
    checks = [rules.fact("Theorem II.6 is feasible everywhere", whole == total, f"{whole} of {total} points")]
    angles = _angles(effort)
    for m3, found in angles.items():
        checks.append(rules.number(f"m3 = {m3:g} kg: theta_max/pi of Theorem II.5, by TS", found["TS"], found["II.5"]))
        checks.append(rules.number(f"m3 = {m3:g} kg: theta_max/pi of TS and Theorem II.5", 0.2, found["TS"]))
    proved = [Sweep(Question("ex-II.8", "II.6").at(point), ()).at({}).verdict for point in EXTREMES]
    trivial = all(verdict is Verdict.FEASIBLE for verdict in proved)
    checks.append(
        rules.fact("(own) II.6 is feasible for any mass, angle and speed", trivial, f"proved at {len(proved)} extremes")
    )
    words = ", ".join(f"{m3:g} kg: {found['TS']:.3f}" for m3, found in angles.items())
    title = "Example II.8, 3-DoF arm without friction, stabilised for proved (m3, theta_max)"
    return Finding(
        checks,
        {**sizes(regions), "theta_max/pi": {f"{m3:g}": found for m3, found in angles.items()}},
        {"": nested_figure(regions, title, ("mass m3 of link 3 (kg)", "largest joint angle theta_max (rad)"))},
        instead=f"Theorem II.5 and TS do agree, but their limit of theta_max/pi depends on m3 ({words}). Theorem II.6"
        " is feasible for every fully actuated arm, by a closed form (conditions/theorems/matched.py): its region shows"
        " no merit of the condition; a test with content would bound the gains",
    )


def _angles(effort: Effort) -> dict[float, dict[str, float]]:
    """Largest proved theta_max/pi of both conditions at every mass; 1 if the whole range is feasible."""
    conditions = {"TS": Question("ex-II.8", "tanaka-wang"), "II.5": Question("ex-II.8", "II.5", options=COMMON)}
    over = Interval("theta_max", 0.02 * pi, pi)
    masses = MASSES_KG[effort]
    asked = {f"{name} {m3}": (question.at({"m3": m3}), over) for m3 in masses for name, question in conditions.items()}
    found = limits(asked, 2e-2 if effort is Effort.QUICK else 2e-3)
    return {m3: {name: (found[f"{name} {m3}"] or 0.0) / pi for name in conditions} for m3 in masses}


ITEMS = (
    Item(
        id="fig-II.4",
        title="Example II.7, stabilisation of a singular system",
        printed={"a": [-13, -8], "b": [-27, -20], "claim": "Corollary 1 nowhere, Theorem II.5 largest"},
        assumptions=("z2 in [0, 1], as in (III.10): the printed regions do not fit the stated [1/2, 1]", PROXIES),
        compute=_fig_ii4,
    ),
    Item(
        id="fig-II.5",
        title="Example II.8, stabilisation of the 3-DoF arm",
        printed={"m3_kg": [1, 15], "theta_max": "[0, pi]", "claim": "II.6 everywhere; II.5 = TS, theta_max <= pi/5"},
        assumptions=("|theta_i'| <= 2 rad/s; I_3 follows m_3 (parallel axes); m_11 and z_4 are corrected", PROXIES),
        compute=_fig_ii5,
    ),
)
