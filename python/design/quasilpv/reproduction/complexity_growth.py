"""Figure II.2: unknowns and rows against the number of premises."""

from __future__ import annotations

from collections.abc import Callable
from math import log

from matplotlib.figure import Figure

from quasilpv.figures.style import BLUE, GREEN, ORANGE, VERMILION, legend_below, new_figure, style
from quasilpv.reproduction import rules
from quasilpv.reproduction.complexity_tables import UNPUBLISHED, bouarar_rows, he_rows
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.reproduction.synthetic import counted

ORDER, PREMISES = 5, 12

Formula = Callable[[int], float]


def _he_unknowns(r: int) -> float:
    """He et al. 2021, Theorem 3.3, Table II.1 as printed, m = 0, one premise in A."""
    n, e, a = ORDER, 2.0 ** (r - 2), 1.0
    return n * n * (2.5 * 2.0**r + e + a + 6) + n * (2.0 ** (r - 1) + e + a)


def _bouarar_unknowns(r: int) -> float:
    """Bouarar et al. 2010, Theorem 2, Table II.1 as printed, m = 0, one premise in A."""
    n = ORDER
    return n * n * (1 + 2.0**3 + 2.0 ** (r - 1)) + n * (1 + 2.0 ** (r - 1))


OTHERS: dict[str, tuple[Formula, Formula]] = {
    "He 2021, Theorem 3.3": (lambda r: he_rows(ORDER, r - 1, 1), _he_unknowns),
    "Bouarar 2010, Theorem 2": (lambda r: bouarar_rows(ORDER, 0, r - 1, 1), _bouarar_unknowns),
}


def crossing(falling: Formula, growing: Formula, largest: int) -> float:
    """Number of premises, interpolated, from which ``growing`` is the larger one; infinite if it never is.

    Args:
        falling, growing: positive, from the number of premises.
        largest: number of premises that is looked at.
    """
    gaps = {r: log(growing(r) / falling(r)) for r in range(2, largest + 1)}
    for r in range(2, largest):
        if gaps[r] < 0.0 <= gaps[r + 1]:
            return r - gaps[r] / (gaps[r + 1] - gaps[r])
    return float("inf")


def _fig_ii2(effort: Effort) -> Finding:
    built = {
        name: {
            r: counted(name, order=ORDER, inputs=0, premises=r) for r in range(2, 4 if effort is Effort.QUICK else 7)
        }
        for name in ("II.5", "II.6")
    }
    rows: dict[str, Formula] = {"II.5": lambda r: 5 * (16 * r**2 + 1), "II.6": lambda r: 5 * (8 * r**2 + 1)}
    unknowns: dict[str, Formula] = {
        "II.5": lambda r: 25 * (8 * r**2 + 32 * r + 0.5) + 5 * (0.5 + 4 * r),
        "II.6": lambda r: 25 * (8 * r + 0.5) + 5 * (0.5 + 2 * r),
    }
    exact = all(
        sizes.rows == rows[name](r) and sizes.unknowns + sizes.slack_unknowns == unknowns[name](r)
        for name, own in built.items()
        for r, sizes in own.items()
    )
    crossings = {
        name: {"N_row": crossing(rows["II.5"], of_rows, 40), "N_var": crossing(unknowns["II.5"], of_unknowns, 40)}
        for name, (of_rows, of_unknowns) in OTHERS.items()
    }
    checks = [rules.fact("(own) the curves drawn pass through the counts of the problems as built", exact, str(exact))]
    checks += [
        rules.number(f"N_row of {name} exceeds the one of Theorem II.5 from about r", 6, found["N_row"])
        for name, found in crossings.items()
    ]
    growth = all(of_rows(r + 1) / of_rows(r) == 2.0 for of_rows, _ in OTHERS.values() for r in range(6, PREMISES))
    checks.append(rules.fact("the others grow exponentially, the proposed ones do not", growth, f"doubling: {growth}"))
    words = "; ".join(f"{name}: N_row {own['N_row']:.1f}, N_var {own['N_var']:.1f}" for name, own in crossings.items())
    return Finding(
        checks,
        {"crossing with Theorem II.5": crossings, "largest r built": max(built["II.5"])},
        {"": _figure(rows, unknowns)},
        instead=f"Premises from which Theorem II.5 is the smaller problem: {words}",
    )


def _figure(rows: dict[str, Formula], unknowns: dict[str, Formula]) -> Figure:
    looks = {
        "Theorem II.5": (BLUE, "o"),
        "Theorem II.6": (GREEN, "s"),
        "He 2021, Theorem 3.3": (VERMILION, "^"),
        "Bouarar 2010, Theorem 2": (ORANGE, "D"),
    }
    named = {f"Theorem {name}": (rows[name], unknowns[name]) for name in rows}
    with style():
        figure = new_figure(3.4, f"Complexity against the number of premises, n = {ORDER} states, m = 0 inputs")
        panels = figure.subplots(1, 2)
        premises = range(2, PREMISES + 1)
        for panel, label, place in zip(panels, ("scalar unknowns N_var", "rows N_row"), (1, 0), strict=True):
            for name, formulas in {**named, **OTHERS}.items():
                colour, marker = looks[name]
                values = [formulas[place](r) for r in premises]
                panel.semilogy(premises, values, color=colour, marker=marker, markersize=3.5, label=name)
            panel.set_xlabel("number of premises r")
            panel.set_ylabel(f"{label} (count)")
            panel.set_xticks(range(2, PREMISES + 1, 2))
        legend_below(panels[0], columns=4)
    return figure


ITEMS = (
    Item(
        id="fig-II.2",
        title="complexity against the number of premises",
        printed={"claim": "similar for r <= 6; above, the others grow exponentially"},
        assumptions=(
            "one premise is in A, the others are in E: the source does not say; with more in A the crossing is earlier",
            UNPUBLISHED + ": their printed formulas are drawn",
        ),
        compute=_fig_ii2,
    ),
)
