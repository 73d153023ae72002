"""A study of this project: what a larger representation, or more slack matrices, buys.

Between one block per premise (2 r vertices) and one block of all (TS, 2^r vertices) lie the partitions of the premises
into groups. For a single sum with slack, merging groups never loses: a majorant ``S_p >= +-X_p`` of every premise gives
``S_p + S_q >= +-X_p +-X_q``. What one block per premise loses at most is known beforehand: it is the matrix-cube
relaxation, and if the vertices of a box are covered by some Lyapunov matrix, the same matrix passes the relaxation on a
box smaller by ``theta(k) <= pi sqrt(k)/2``, ``theta(2) = pi/2``, k the largest rank of the X_p, whatever their number
(Ben-Tal and Nemirovski 2002). Double sums have no such guarantee.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

from matplotlib.figure import Figure

from quasilpv.conditions.condition import Options
from quasilpv.conditions.forms.extended import extended_state
from quasilpv.conditions.forms.slack import Slack
from quasilpv.figures.style import BLUE, ORANGE, VERMILION, new_figure, style
from quasilpv.lmi.exact import rank_factors
from quasilpv.reproduction import rules
from quasilpv.reproduction.grids import limits
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.studies.boundary import Interval
from quasilpv.studies.complexity import count
from quasilpv.studies.question import Question

TOLERANCE = {Effort.QUICK: 1e-2, Effort.FULL: 1e-3}

LOOKS = {Slack.NONE: ("x", VERMILION), Slack.THESIS: ("o", BLUE), Slack.FULL: ("s", ORANGE)}


@dataclass(frozen=True)
class Dial:
    """One problem: how far a parameter can go.

    Attributes:
        title: of its panel.
        question: without representation and slack.
        over: the parameter, from a feasible end.
        label: of the parameter, with unit.
        partitions: representations, coarser ones later.
        single_sum: whether the condition is a single sum.
    """

    title: str
    question: tuple[str, str, tuple[tuple[str, float], ...]]
    over: Interval
    label: str
    partitions: Sequence[str]
    single_sum: bool = False

    def asked(self) -> dict[tuple[str, Slack], Question]:
        """All combinations of representation and slack that are different problems."""
        families = [Slack.NONE, Slack.THESIS]
        if not self.single_sum:
            families.append(Slack.FULL)
        system, condition, parameters = self.question
        return {
            (representation, slack): Question(system, condition, representation, parameters, Options(slack=slack))
            for representation in self.partitions
            for slack in (families if representation != "ts" else [Slack.THESIS])
        }


THREE = ("per-premise", "grouped=0,1+2", "grouped=0+1,2", "grouped=0+2,1", "ts")

DIALS = (
    Dial(
        "2-DoF arm, Theorem I.1",
        ("arm2", "I.1", (("fv1", 10.0), ("fv2", 20.0), ("theta_max", pi / 6))),
        Interval("speed_max", 0.05, 60.0),
        "largest joint speed (rad/s)",
        ("per-premise", "grouped=0,1+2,3+4", "grouped=0,1+2,3,4", "grouped=0,1+2+3+4", "grouped=0+1+2,3+4", "ts"),
        single_sum=True,
    ),
    Dial("Example I.1, Theorem II.6", ("ex-I.1", "II.6", (("a", 1.0),)), Interval("b", 0.0, 6.0), "b (no unit)", THREE),
    Dial(
        "Example II.7, Theorem I.2",
        ("ex-II.7", "I.2", (("b", -25.0), ("z2_lower", 0.0))),
        Interval("a", -8.0, -14.0),
        "-a (no unit)",
        THREE,
    ),
    Dial(
        "Example III.11, Theorem I.2",
        ("ex-III.11", "I.2", (("b", -25.0), ("z2_lower", 0.0))),
        Interval("a", -8.0, -14.0),
        "-a (no unit)",
        THREE,
    ),
)


def _study(effort: Effort) -> Finding:
    results = {dial.title: _measured(dial, effort) for dial in DIALS}
    arm = {(row["representation"], row["slack"]): row["limit"] or 0.0 for row in results[DIALS[0].title]}
    theta = guarantee(DIALS[0])
    ratio = arm["ts", Slack.THESIS] / arm["per-premise", Slack.THESIS]
    slack = (1.0 + TOLERANCE[effort]) ** 2
    groups = [name for name in DIALS[0].partitions if name not in {"per-premise", "ts"}]
    between = all(
        arm["per-premise", Slack.THESIS] <= slack * arm[name, Slack.THESIS] <= slack**2 * arm["ts", Slack.THESIS]
        for name in groups
    )
    checks = [
        rules.fact(
            "(own) single sum: every partition lies between per-premise and TS", between, f"{len(groups)} partitions"
        ),
        rules.fact(
            "(own) TS exceeds per-premise by the guaranteed factor at most",
            ratio <= theta * slack,
            f"{ratio:.3f} <= {theta:.3f}",
        ),
    ]
    words = "; ".join(f"{title}: {_summary(rows)}" for title, rows in results.items())
    return Finding(checks, {"guaranteed factor": theta, "limits": results}, {"": _figure(results)}, instead=words)


def guarantee(dial: Dial) -> float:
    """theta(k) for the largest rank k of ``He(P' X_p)``, at most twice the rank of the slope of premise p."""
    system, condition, parameters = dial.question
    model = Question(system, condition, "per-premise", parameters).model()
    _, slopes = model.spread(lambda E, A, B: extended_state(E, A, model.differential))
    rank = max(2 * rank_factors(slope)[0].shape[1] for slope in slopes.values())
    return pi / 2 if rank == 2 else pi * sqrt(rank) / 2


def _measured(dial: Dial, effort: Effort) -> list[dict[str, Any]]:
    asked = dial.asked()
    found = limits({str(key): (question, dial.over) for key, question in asked.items()}, TOLERANCE[effort])
    rows = []
    for (representation, slack), question in asked.items():
        sizes = count(question)
        limit = found[str((representation, slack))]
        rows.append(
            {
                "representation": representation,
                "slack": slack,
                "vertices": sizes.vertices,
                "unknowns": sizes.unknowns + sizes.slack_unknowns,
                "rows": sizes.rows,
                "limit": None if limit is None else abs(limit),
            }
        )
    return rows


def _summary(rows: Sequence[Mapping[str, Any]]) -> str:
    best = max(row["limit"] or 0.0 for row in rows)
    named = {(row["representation"], row["slack"]): (row["limit"] or 0.0) / best for row in rows}
    plain, slack = named["per-premise", Slack.NONE], named["per-premise", Slack.THESIS]
    return (
        f"per premise without slack {plain:.0%}, with slack {slack:.0%}, TS {named['ts', Slack.THESIS]:.0%} of the best"
    )


def _figure(results: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure:
    with style():
        figure = new_figure(6.4, "Conservatism against complexity: partitions of the premises, slack matrices")
        panels = figure.subplots(2, 2).ravel()
        for panel, dial in zip(panels, DIALS, strict=True):
            place = {name: k for k, name in enumerate(dial.partitions)}
            for slack, (marker, colour) in LOOKS.items():
                own = [row for row in results[dial.title] if row["slack"] is slack and row["limit"] is not None]
                if own:
                    at = [place[row["representation"]] for row in own], [row["limit"] for row in own]
                    panel.plot(*at, linestyle="none", marker=marker, color=colour, fillstyle="none", label=slack.value)
            vertices = {row["representation"]: (row["vertices"], row["rows"]) for row in results[dial.title]}
            ticks = [f"{_short(name)}\n{vertices[name][0]} vert., {vertices[name][1]} rows" for name in dial.partitions]
            panel.set_xticks(range(len(ticks)), ticks, fontsize=6.5, rotation=40, ha="right", rotation_mode="anchor")
            panel.set_title(dial.title)
            panel.set_ylabel(dial.label)
            panel.margins(x=0.08, y=0.1)
        handles, labels = panels[1].get_legend_handles_labels()
        figure.legend(handles, [f"slack: {label}" for label in labels], loc="outside lower center", ncols=3)
    return figure


def _short(representation: str) -> str:
    return representation.removeprefix("grouped=").replace("per-premise", "one each").replace("ts", "all (TS)")


ITEMS = (
    Item(
        id="study-conservatism",
        title="conservatism against complexity: partitions of the premises and slack matrices (own study)",
        printed={},
        assumptions=(),
        compute=_study,
    ),
)
