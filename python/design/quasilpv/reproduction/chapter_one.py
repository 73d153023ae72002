"""Figures of chapter I: the two arms as stabilisation problems, TS against the reduced affine representation."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from quasilpv.conditions.condition import Form
from quasilpv.lmi.compiled import CompiledProblem
from quasilpv.reproduction import rules
from quasilpv.reproduction.grids import axis, grid, nested_figure, sizes
from quasilpv.reproduction.item import Check, Effort, Finding, Item
from quasilpv.studies.answer import Verdict
from quasilpv.studies.question import Question
from quasilpv.studies.region import Region
from quasilpv.studies.sweep import Sweep

ARM2_AXES = ("mass m2 of link 2 (kg)", "friction fv1 = fv2/2 (N m s/rad)")
ARM3_AXES = ("mass m3 of link 3 (kg)", "friction fv of every joint (N m s/rad)")

THETA_MAX = 0.6
"""rad: both theorems then separate the two representations without emptying either region."""

FRICTION = "fv1 = 0.5 fv2 in [0, 50] is read as fv1 in [0, 50]"
SIGNS = "the printed H and N are those of the right-hand side: theta = 0 hangs and friction dissipates"
OPERATING = "the operating domain, which is not stated, is |theta_i| <= 0.6 rad, |theta_i'| <= 2 rad/s"
WHOLE_TURN = "the operating domain, which is not stated, is |theta_i| <= pi, |theta_i'| <= 2 rad/s"
JOINT_AXIS = "I_3 follows m_3 (parallel axes); m_11 and z_4 are corrected"

FREE_OF_FRICTION = (
    "Regions of parallel distributed compensation (Theorem I.2) do not depend on friction or speed bounds, whatever is"
    " plotted: B is constant, so the projection lemma removes the gains, and what remains, He(E_i P_22) > 0 at the"
    " vertices and one inequality without premises, sees the inertia matrix only"
)
FREE_OF_EVERYTHING = (
    "The extended law (I.53) exists for every mechanical system with B = [0; I]: without its gains one inequality"
    " remains, which holds no premise and no parameter; everything is feasible, which says nothing of conservatism"
)


def _arm2_map(condition: str, representation: str, effort: Effort) -> Region:
    question = Question("arm2", condition, representation, (("theta_max", THETA_MAX), ("speed_max", 2.0)))
    x = axis("m2", 1.0, 7.0, effort, quick=7, full=13)
    y = axis("fv1", 0.0, 50.0, effort, quick=6, full=11)
    return grid(question, x, y, lambda m2, fv1: {"fv2": 2.0 * fv1})


def _fig_i4(effort: Effort) -> Finding:
    maps = {
        theorem: {
            "TS, 32 vertices": _arm2_map(theorem, "ts", effort),
            "reduced, 6 vertices": _arm2_map(theorem, "reduced", effort),
        }
        for theorem in ("I.1", "I.2")
    }
    checks = []
    for theorem, regions in maps.items():
        ts, reduced = (rules.feasible(region) for region in regions.values())
        claim = f"Theorem {theorem}: the reduced region is strictly inside the one of TS"
        checks.append(rules.strict_inclusion(claim, reduced, ts))
        checks.append(
            rules.fact(f"Theorem {theorem}: neither is empty", bool(reduced and ts), f"{len(reduced)} points")
        )
    design = maps["I.2"]["reduced, 6 vertices"]
    checks.append(_one_verdict_per_column(design))
    checks.append(_published_agrees(design))
    ends = [{"fv1": 0.0, "fv2": 0.0}, {"fv1": 50.0, "fv2": 100.0}]
    checks.append(_same_inequalities(design.question, ends, "friction"))
    titles = {"I.1": "admissibility (Theorem I.1)", "I.2": "stabilisation (Theorem I.2)"}
    figures = {
        name: nested_figure(maps[theorem], f"2-DoF arm, {titles[theorem]}, |theta| <= {THETA_MAX:g} rad", ARM2_AXES)
        for name, theorem in (("a", "I.1"), ("b", "I.2"))
    }
    numbers = {theorem: sizes(regions) for theorem, regions in maps.items()}
    return Finding(checks, numbers, figures, instead=FREE_OF_FRICTION)


def _fig_i5(effort: Effort) -> Finding:
    regions = {
        "TS, Theorem I.2, 32 vertices": _arm2_map("I.2", "ts", effort),
        "reduced, (I.53), 6 vertices": _arm2_map("I.53", "reduced", effort),
    }
    ts, extended = (rules.feasible(region) for region in regions.values())
    question = regions["reduced, (I.53), 6 vertices"].question
    ends = [{"m2": 1.0, "fv1": 0.0}, {"m2": 7.0, "fv1": 50.0}]
    checks = [
        rules.same_region("(I.53) on the reduced model has the region of TS", extended, ts),
        _same_inequalities(question, ends, "mass and friction"),
    ]
    title = "2-DoF arm, extended compensation (I.53) on the reduced model, and TS"
    return Finding(checks, sizes(regions), {"": nested_figure(regions, title, ARM2_AXES)}, instead=FREE_OF_EVERYTHING)


def _fig_i7(effort: Effort) -> Finding:
    question = Question("arm3", "I.53", "reduced", (("theta_max", pi), ("speed_max", 2.0)))
    x = axis("m3", 1.0, 15.0, effort, quick=8, full=15)
    y = axis("fv", 0.0, 100.0, effort, quick=6, full=11)
    regions = {"reduced, (I.53), 13 vertices": grid(question, x, y)}
    (region,) = regions.values()
    proved = len(rules.feasible(region))
    ends = [{"m3": 1.0, "fv": 0.0}, {"m3": 15.0, "fv": 100.0}]
    checks = [
        rules.fact("feasible everywhere", proved == len(region.points), f"{proved} of {len(region.points)} points"),
        _same_inequalities(question, ends, "mass and friction"),
    ]
    title = "3-DoF arm, extended compensation (I.53) on the reduced model, 13 vertices"
    return Finding(checks, sizes(regions), {"": nested_figure(regions, title, ARM3_AXES)}, instead=FREE_OF_EVERYTHING)


def _one_verdict_per_column(region: Region) -> Check:
    columns = [{p.answer.verdict for p in region.points if p.x == x} for x in region.x.values]
    single = sum(len(column) == 1 for column in columns)
    claim = "(own) at every mass the verdict of Theorem I.2 is the same for all friction"
    return rules.fact(claim, single == len(columns), f"one verdict in {single} of {len(columns)} columns")


def _published_agrees(region: Region) -> Check:
    """The condition with all gains, at both ends of the friction range and of the masses."""
    question = replace(region.question, options=replace(region.question.options, form=Form.PUBLISHED))
    known = {(p.x, p.y): p.answer.verdict for p in region.points}
    ends = [(m2, fv1) for m2 in (region.x.start, region.x.end) for fv1 in (region.y.start, region.y.end)]
    sweep = Sweep(question, ("m2", "fv1", "fv2"))
    answers = {place: sweep.at({"m2": place[0], "fv1": place[1], "fv2": 2.0 * place[1]}).verdict for place in ends}
    same = sum(answers[place] is known[place] for place in ends)
    feasible = sum(verdict is Verdict.FEASIBLE for verdict in answers.values())
    claim = "(own) with its gains the published condition gives the same verdicts"
    return rules.fact(claim, same == len(ends), f"{same} of {len(ends)} corners, {feasible} feasible")


def _same_inequalities(question: Question, ends: list[dict[str, float]], what: str) -> Check:
    """The eliminated inequalities at two parameter points, coefficient by coefficient."""
    first, second = (CompiledProblem.of(question.at(point).statement().problem).matrix()[0] for point in ends)
    equal = first.shape == second.shape and not (first != second).nnz
    found = f"{'the same' if equal else 'other'} coefficients at {ends[0]} and {ends[1]}"
    return rules.fact(f"(own) without its gains the problem does not see {what}", equal, found)


ITEMS = (
    Item(
        id="fig-I.4",
        title="2-DoF arm, regions of Theorems I.1 and I.2: TS and reduced representation",
        printed={"m2_kg": [1, 7], "fv1": [0, 50], "claim": "reduced strictly inside TS"},
        assumptions=(SIGNS, FRICTION, OPERATING),
        compute=_fig_i4,
    ),
    Item(
        id="fig-I.5",
        title="2-DoF arm, extended compensation (I.53) on the reduced representation",
        printed={"m2_kg": [1, 7], "fv1": [0, 50], "claim": "same region as TS"},
        assumptions=(SIGNS, FRICTION, OPERATING),
        compute=_fig_i5,
    ),
    Item(
        id="fig-I.7",
        title="3-DoF arm, extended compensation (I.53) on the reduced representation",
        printed={"m3_kg": [1, 15], "fv": [0, 100], "claim": "feasible everywhere"},
        assumptions=(JOINT_AXIS, WHOLE_TURN),
        compute=_fig_i7,
    ),
)
