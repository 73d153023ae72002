"""Figure II.1: what the premises of Example II.5 can be, and the polytopes that are drawn around it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from quasilpv.figures.style import BLACK, BLUE, GREEN, ORANGE, VERMILION, new_figure, style
from quasilpv.polytopes import polytopic_model
from quasilpv.reproduction import rules
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.systems.catalogue import system

Vertices = npt.NDArray[np.float64]

SHIFTS = {"shifted (II.16)": ((1.0, 1.0), (-1.0, -1.0)), "shifted (II.17)": ((1.0, -1.0), (-1.0, 1.0))}
"""What is added to the vertices of either block: their sum is zero."""

PRINTED = {
    "proposed": [(-2, 0), (2, 0), (0, -2), (0, 2)],
    "TS": [(-1, -1), (-1, 1), (1, -1), (1, 1)],
    "shifted (II.16)": [(-1, 1), (3, 1), (-1, -3), (-1, 1)],
    "shifted (II.17)": [(-1, -1), (3, -1), (-1, -1), (-1, 3)],
}
"""(II.14) to (II.17), vertices in printed order, with z^0 = -1 and z^1 = 1."""


def _polytopes() -> dict[str, Vertices]:
    example = system("ex-II.5")
    names = {"proposed": "per-premise@0", "TS": "ts", "reduced": "reduced"}
    found = {name: polytopic_model(example, own).polytope.vertex_offsets for name, own in names.items()}
    for name, shift in SHIFTS.items():
        found[name] = found["proposed"] + np.repeat(np.array(shift), 2, axis=0)
    return found


def _contains(outer: Vertices, points: Vertices) -> bool:
    faces = ConvexHull(outer).equations
    return bool((points @ faces[:, :-1].T + faces[:, -1] <= 1e-12).all())


def _fig_ii1(_: Effort) -> Finding:
    found = _polytopes()
    checks = [
        rules.fact(
            f"vertices {name}: {list(map(tuple, printed))}",
            bool(np.array_equal(found[name], printed)),
            _text(found[name]),
        )
        for name, printed in PRINTED.items()
    ]
    first, last = found["shifted (II.16)"][[0, 3]]
    corner = bool(np.array_equal(first, last)) and tuple(first) in set(map(tuple, found["TS"]))
    checks.append(rules.fact("(II.16): V_1* and V_4* coincide in a vertex of TS", corner, _text(first[None])))
    reduced = {tuple(vertex) for vertex in found["reduced"]}
    same = {tuple(vertex) for vertex in found["shifted (II.17)"]} == reduced
    checks.append(rules.fact("(II.17) is the polytope of the reduced representation", same, _text(found["reduced"])))
    others = [name for name in found if name != "TS"]
    inside = all(_contains(found[name], found["TS"]) for name in others)
    areas = {name: float(ConvexHull(vertices).volume) for name, vertices in found.items()}
    larger = inside and all(areas[name] > areas["TS"] for name in others)
    checks.append(rules.fact("all others contain the TS polytope and are larger", larger, f"areas {areas}"))
    circle = np.stack([np.cos(angle := np.linspace(0, 2 * np.pi, 720)), np.sin(angle)], axis=1)
    enclosed = all(_contains(vertices, circle) for vertices in found.values())
    checks.append(rules.fact("all contain the set of premises", enclosed, str(enclosed)))
    return Finding(
        checks,
        {"vertices": {name: vertices.tolist() for name, vertices in found.items()}, "areas": areas},
        {"": _figure(found, circle)},
        instead="The vertex in which V_1* and V_4* coincide, (-1, 1), is the one (II.14) numbers 2, not 1",
    )


def _text(vertices: Vertices) -> str:
    return ", ".join(f"({x:g}, {y:g})" for x, y in vertices)


def _with_twin(name: str, polytopes: Mapping[str, Vertices]) -> str:
    """A name, and which polytope before it is the same set: their outlines lie on each other."""
    own = {tuple(vertex) for vertex in polytopes[name]}
    before = list(polytopes)[: list(polytopes).index(name)]
    twins = [other for other in before if {tuple(vertex) for vertex in polytopes[other]} == own]
    return f"{name} = {twins[0]}" if twins else name


def _figure(polytopes: Mapping[str, Vertices], circle: Vertices) -> Figure:
    looks = {
        "TS": (BLUE, "--", "s"),
        "proposed": (GREEN, "-", "o"),
        "shifted (II.16)": (ORANGE, "-.", "^"),
        "shifted (II.17)": (VERMILION, (0, (6, 2)), "v"),
        "reduced": (BLACK, ":", "x"),
    }
    with style():
        figure = new_figure(4.2, "Example II.5: set of premises and polytopes around it")
        axes = figure.add_subplot(aspect="equal")
        axes.plot(*circle.T, color="#8c8c8c", linewidth=2.0, label="premises (cos x1, sin x1)")
        for name, (colour, line, marker) in looks.items():
            vertices = polytopes[name]
            outline = vertices[[*ConvexHull(vertices).vertices, ConvexHull(vertices).vertices[0]]]
            label = _with_twin(name, polytopes)
            axes.plot(
                *outline.T, color=colour, linestyle=line, marker=marker, markersize=5.0, label=label, fillstyle="none"
            )
        axes.set_xlabel("premise z1 = cos x1 (no unit)")
        axes.set_ylabel("premise z2 = sin x1 (no unit)")
        axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0)
    return figure


ITEMS = (
    Item(
        id="fig-II.1",
        title="premises of Example II.5 and the polytopes around them",
        printed={name: [list(vertex) for vertex in vertices] for name, vertices in PRINTED.items()},
        assumptions=("vertices are numbered lower bound first, as in (II.14)",),
        compute=_fig_ii1,
    ),
)
