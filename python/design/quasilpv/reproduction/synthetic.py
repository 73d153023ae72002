"""Sizes of conditions that are too large to build, or known as formulas: counted on systems made for it.

The sizes of a condition depend on the orders n and m, the number of premises and the representation only, not on what
the numbers of the system are.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import sympy as sp

from quasilpv.conditions.condition import Form, Options
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.registry import condition
from quasilpv.polytopes import PolytopicModel, polytopic_model
from quasilpv.reproduction.counting import equal_indices
from quasilpv.studies.complexity import Complexity, measured
from quasilpv.systems.descriptor.premise import AffineMatrix, Premise
from quasilpv.systems.descriptor.system import DescriptorSystem


def counted(name: str, *, order: int, inputs: int, premises: int) -> Complexity:
    """Sizes of a condition as published, in its own representation, for a regular system of these sizes.

    Args:
        name: of the condition.
        order: n.
        inputs: m.
        premises: r, at least 1.
    """
    known = condition(name)
    model = polytopic_model(_system(order, inputs, premises), known.representation)
    return measured(known.build(model, Options(form=Form.PUBLISHED)), model.vertex_count)


def single_sum_at(name: str, *, order: int, inputs: int, vertices: int, common: bool = False) -> dict[str, int]:
    """Unknowns (without slack matrices) and rows of a single sum over so many vertices.

    Both are affine in the number of vertices; the line is drawn through the counts at three and four vertices, and
    checked at eight.

    Args:
        name: of the condition.
        order: n.
        inputs: m.
        vertices: may be too many to build.
        common: see `Options.common`.

    Raises:
        ValueError: the count at eight vertices is not on the line.
    """
    options = Options(slack=Slack.NONE, form=Form.PUBLISHED, common=common)

    def sizes(premises: int, representation: str) -> Complexity:
        model: PolytopicModel = polytopic_model(_system(order, inputs, premises), representation)
        statement = condition(name).build(model, options)
        return measured(statement, model.vertex_count, equal_indices(statement.problem))

    three, four, eight = sizes(2, "reduced"), sizes(2, "ts"), sizes(3, "ts")
    values = {}
    for quantity in ("unknowns", "rows"):
        low, high, check = (getattr(count, quantity) for count in (three, four, eight))
        slope = Fraction(high - low, four.vertices - three.vertices)
        if low + slope * (eight.vertices - three.vertices) != check:
            raise ValueError(f"{name}: {quantity} are not affine in the number of vertices")
        values[quantity] = int(low + slope * (vertices - three.vertices))
    return values


def _system(order: int, inputs: int, premises: int) -> DescriptorSystem:
    """Premise 1 is in E, all are in A; B is constant."""
    n, m, r = order, inputs, premises
    E, A = (np.zeros((r, n, n)) for _ in "EA")
    E[0] = 0.5 * np.eye(n)
    A[:] = np.eye(n)
    symbols = sp.symbols(f"p1:{r + 1}", real=True)
    return DescriptorSystem(
        name=f"synthetic-{n}-{m}-{r}",
        state=sp.symbols(f"x1:{n + 1}", real=True),
        inputs=tuple(f"u{k}" for k in range(m)),
        premises=tuple(Premise(p.name, p, (-1.0, 1.0)) for p in symbols),
        E=AffineMatrix(np.eye(n), E),
        A=AffineMatrix(-np.eye(n), A),
        B=AffineMatrix(np.ones((n, m)), np.zeros((r, n, m))),
        C=AffineMatrix(np.eye(n), np.zeros((r, n, n))),
        domain={p: (-1.0, 1.0) for p in symbols},
    )
