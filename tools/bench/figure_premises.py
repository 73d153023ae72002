"""figure_premises.py DIR: draws DIR/step-cost-premises.png (and .svg) from what tools/bench/premises kept."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from bench_report import KEPT
from matplotlib.figure import Figure

from quasilpv.figures.style import BLACK, BLUE, VERMILION, new_figure, save, style

NAME = re.compile(r"(\w+), (\d+) premises")
CURVES = (
    ("collapsed", "one block per premise, collapsed at load", BLUE, "o"),
    ("dense", r"one block of all premises, $2^p$ vertices", VERMILION, "s"),
)
LIMIT_US = 10.0


def premises_figure(rows: list[dict[str, object]]) -> Figure:
    """CPU time of a step against the number of premises, both layouts, and what is a hundredth of a sample at 1 kHz."""
    with style():
        figure = new_figure(3.4, "Control step of a torque-level law, seven joints, warm")
        axes = figure.subplots()
        for layout, label, colour, marker in CURVES:
            points = [
                (int(match[2]), row["value"])
                for row in rows
                if (match := NAME.match(str(row["name"]))) and match[1] == layout
            ]
            axes.plot(*zip(*sorted(points), strict=True), color=colour, marker=marker, markersize=3.5, label=label)
        axes.axhline(LIMIT_US, color=BLACK, linewidth=0.8, linestyle=(0, (4, 2)), label="1 % of 1 ms")
        axes.set_yscale("log")
        axes.set_xticks(range(0, 21, 2))
        axes.set_xlabel("number of premises $p$")
        axes.set_ylabel("CPU time per step (µs)")
        figure.legend(loc="outside lower center", ncols=3, handlelength=2.2)
        return figure


if __name__ == "__main__":
    kept = json.loads((KEPT / "premises.json").read_text(encoding="utf-8"))
    save(premises_figure(kept["rows"]), Path(sys.argv[1]) / "step-cost-premises")
