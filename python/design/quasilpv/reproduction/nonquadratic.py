"""Figure II.7: quadratic and nonquadratic conditions on Example II.9, and why the latter gain nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from quasilpv.conditions.condition import Options
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.registry import condition
from quasilpv.figures.style import BLACK, BLUE, GREEN, ORANGE, VERMILION, new_figure, style
from quasilpv.lmi import Outcome
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.lmi.feasibility import decide
from quasilpv.polytopes import polytopic_model
from quasilpv.reproduction import rules
from quasilpv.reproduction.grids import axis, grid, limits, nested_figure, sizes
from quasilpv.reproduction.item import Check, Effort, Finding, Item
from quasilpv.studies.answer import Verdict
from quasilpv.studies.boundary import Interval
from quasilpv.studies.question import Question
from quasilpv.studies.sweep import Sweep
from quasilpv.systems.descriptor.premise import AffineMatrix

METHODS = {
    "TS-Pj": ("TS-Pj", "ts"),
    "Theorem II.5": ("II.5", "per-premise@0"),
    "Theorem II.6": ("II.6", "per-premise@0"),
    "Guerra 2007": ("guerra-2007", "ts"),
}

LOOKS = {
    "TS-Pj": (BLACK, "o"),
    "Theorem II.6, full slack": (ORANGE, "D"),
    "Theorem II.5": (BLUE, "s"),
    "Theorem II.6": (GREEN, "^"),
    "Guerra 2007": (VERMILION, "v"),
}

A_LINE = 1.0
"""The line a = 1 along which the large conditions are compared."""

GAIN = 1.03
"""A gain in b below 3 % cannot be seen in a map of 41 points over [-20, 20]."""

NEAR = 0.95
"""Where a solution of Theorem II.8 is looked at, relative to the limit of Theorem II.6."""

NO_GAIN = (
    "Theorems II.7 and II.8 treat the mean weights varpi as independent of z(t) and z(t - tau). Put both equal to z:"
    " the derivative of P(varpi) vanishes, so for any fixed varpi* P(varpi*) is a common quadratic Lyapunov matrix of"
    " the memoryless law with the same gains; what no such law stabilises quadratically is out of reach for every tau,"
    " and tau -> 0 is the largest region of all"
)


def _fig_ii7(effort: Effort) -> Finding:
    x = axis("a", -8.0, 8.0, effort, quick=9, full=17)
    y = axis("b", -20.0, 20.0, effort, quick=9, full=21)
    regions = {name: grid(Question("ex-II.9", *method), x, y) for name, method in METHODS.items()}
    places = {name: rules.feasible(region) for name, region in regions.items()}
    five, six, guerra = (places[name] for name in ("Theorem II.5", "Theorem II.6", "Guerra 2007"))
    along = _largest_b(effort)
    at_line = {name: found[A_LINE] for name, found in along.items()}
    checks = [
        rules.inclusion("Guerra 2007 is inside Theorem II.6", guerra, six),
        rules.same_region("Theorems II.5 and II.6 have the same region", five, six),
        rules.fact(
            "Theorem II.6 gives more than Guerra 2007 at every a that was looked at",
            all(along["Theorem II.6"][a] > b for a, b in along["Guerra 2007"].items()),
            f"largest b of Guerra 2007 {along['Guerra 2007']}, of Theorem II.6 {along['Theorem II.6']}",
        ),
        _reaches_further("II.7", "II.5", at_line),
        _reaches_further("II.8", "II.6", at_line),
        _is_quadratic(at_line["Theorem II.6"]),
        _misprint(),
    ]
    title = "Example II.9, stabilised for proved pairs (a, b)"
    return Finding(
        checks,
        {**sizes(regions), "largest proved b at a": along},
        {"": nested_figure(regions, title, ("a (no unit)", "b (no unit)")), "limits": _limits_figure(along)},
        instead=NO_GAIN + ". Largest proved b at a = 1: " + ", ".join(f"{name} {b:.3g}" for name, b in at_line.items()),
    )


def _largest_b(effort: Effort) -> dict[str, dict[float, float]]:
    """Largest proved b along lines of constant a, by bisection."""
    questions = {
        "Guerra 2007": Question("ex-II.9", "guerra-2007"),
        "Theorem II.6": Question("ex-II.9", "II.6"),
        "Theorem II.6, full slack": Question("ex-II.9", "II.6", options=Options(slack=Slack.FULL)),
        "Theorem II.5": Question("ex-II.9", "II.5"),
        "TS-Pj": Question("ex-II.9", "TS-Pj", "ts"),
    }
    lines = (A_LINE, 3.0, 6.0) if effort is Effort.QUICK else (0.5, A_LINE, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
    over = Interval("b", 0.0, 8.0)
    asked = {f"{name} {a}": (question.at({"a": a}), over) for name, question in questions.items() for a in lines}
    found = limits(asked, 1e-2 if effort is Effort.QUICK else 2e-3)
    return {name: {a: found[f"{name} {a}"] or 0.0 for a in lines} for name in questions}


def _limits_figure(along: Mapping[str, Mapping[float, float]]) -> Figure:
    with style():
        figure = new_figure(3.6, "Example II.9, largest proved b along lines of constant a")
        axes = figure.add_subplot()
        for name, (colour, marker) in LOOKS.items():
            places = np.array(list(along[name].items()))
            axes.semilogy(*places.T, color=colour, marker=marker, label=name, fillstyle="none")
        axes.set_xlabel("a (no unit)")
        axes.set_ylabel("largest b (no unit)")
        axes.yaxis.set_major_formatter(ScalarFormatter())
        axes.yaxis.set_minor_formatter(ScalarFormatter())
        axes.legend(loc="upper right")
    return figure


def _reaches_further(delayed: str, quadratic: str, along: Mapping[str, float]) -> Check:
    """A condition with memory, in the limit, 3 % beyond the limit of its quadratic counterpart."""
    beyond = GAIN * along[f"Theorem {quadratic}"]
    answer = Sweep(Question("ex-II.9", delayed, parameters=(("a", A_LINE), ("b", beyond))), ()).at({})
    claim = f"Theorem {delayed} reaches more than 3 % further than Theorem {quadratic} at a = 1"
    return rules.fact(
        claim, answer.verdict is Verdict.FEASIBLE, f"{answer.verdict.value} at b = {beyond:.3f}, tau -> 0"
    )


def _is_quadratic(quadratic: float) -> Check:
    """A solution of Theorem II.8 near the limit: its P(varpi*) is a quadratic Lyapunov matrix at all premises."""
    question = Question("ex-II.9", "II.8", parameters=(("a", A_LINE), ("b", NEAR * quadratic)))
    statement, model = question.statement(), question.model()
    decision = decide(CompiledProblem.of(statement.problem))
    if not decision.feasible:
        return rules.fact("(own) a solution of Theorem II.8 is quadratic", False, decision.outcome.value)
    feedback = statement.feedback(decision.values)
    assert feedback.gain is not None
    low, high = model.system.lower, model.system.upper
    random = np.random.default_rng(0)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(len(low), -1).T
    largest = -np.inf
    for z in [*corners, *random.uniform(low, high, (500, len(low)))]:
        system = model.system.evaluate(z)
        closed = np.linalg.solve(system.E, system.A + system.B @ feedback.gain(z)) @ feedback.lyapunov
        largest = max(largest, float(np.linalg.eigvalsh(closed + closed.T)[-1]))
    claim = "(own) P(varpi*) of a solution of Theorem II.8 is a common quadratic Lyapunov matrix"
    return rules.fact(
        claim, largest < 0.0, f"largest eigenvalue of He(E^-1 (A + B K) P) over {500 + len(corners)} z: {largest:.3g}"
    )


def _misprint() -> Check:
    """(I.10) with B_1 = z_2: at z = 0 the first row of [A B] vanishes, and no condition is feasible."""
    correct = Question("ex-II.9", "II.6").model().system
    first = np.zeros(correct.B.shape)
    first[0, 0] = 1.0
    printed = replace(correct, B=AffineMatrix(correct.B.constant - first, correct.B.coefficients))
    matrices = printed.evaluate(np.zeros(3))
    row = np.concatenate([matrices.A[0], matrices.B[0]])
    statement = condition("TS-Pj").build(polytopic_model(printed, "ts"), Options())
    outcome = decide(CompiledProblem.of(statement.problem)).outcome
    claim = "(own) with (I.10) as printed the pole 0 is uncontrollable at z = 0, and TS-Pj is infeasible at a = b = 1"
    holds = not row.any() and outcome is Outcome.INFEASIBLE_NUMERICALLY
    return rules.fact(claim, holds, f"row 1 of [A B] at z = 0: {row.tolist()}; {outcome.value}")


ITEMS = (
    Item(
        id="fig-II.7",
        title="Example II.9, quadratic and nonquadratic stabilisation",
        printed={
            "a": [-8, 8],
            "b": [-20, 20],
            "claim": "Zhang 2017 < Guerra 2007 < II.5 = II.6 < II.7 = II.8 (tau = 5e-6 s)",
        },
        assumptions=(
            "B_1 = 1 + z_2 as in (I.9): with (I.10) as printed the pole 0 is uncontrollable and nothing is feasible",
            "the theorem of Zhang 2017 is not restated in the source and not compared",
            "II.7 and II.8 are taken in the limit tau -> 0, which contains their regions for every tau > 0",
        ),
        compute=_fig_ii7,
    ),
)
