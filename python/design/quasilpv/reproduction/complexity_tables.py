"""Tables of complexity: every number counted from the problem as built, beside the printed one."""

from __future__ import annotations

from quasilpv.conditions.condition import Options
from quasilpv.conditions.forms.slack import Slack, slack_family
from quasilpv.reproduction.counting import Row, printed_labels, single_sum, symmetric, table_finding
from quasilpv.reproduction.item import Effort, Finding, Item
from quasilpv.reproduction.synthetic import counted, single_sum_at
from quasilpv.studies.complexity import Complexity, count
from quasilpv.studies.question import Question

SINGLE_SUM = "of a double sum the inequalities with i = j are counted, since B is constant"
REDUCED_MODEL = (
    "for the reduced representation the source counts r + 2 inequalities and r + 3 gains (r + 1 vertices are needed),"
    " and one symmetric slack matrix of order 2n that its text does not have"
)
UNPUBLISHED = "columns of other authors' theorems, which the source does not restate, are not counted"


def _pair(sizes: Complexity) -> dict[str, int]:
    labels = printed_labels(sizes)
    return {quantity: labels[quantity] for quantity in ("N_var", "N_row")}


def _at(condition: str, order: int, inputs: int, vertices: int, common: bool = False) -> dict[str, int]:
    """Sizes of a single sum, slack matrices not counted."""
    sizes = single_sum_at(condition, order=order, inputs=inputs, vertices=vertices, common=common)
    return {"N_var": sizes["unknowns"], "N_row": sizes["rows"]}


def _table_i2(_: Effort) -> Finding:
    n, m = 4, 2
    extra = {"N_var": symmetric(2 * n), "N_row": 2 * n}
    gains = {**extra, "N_var": extra["N_var"] + 2 * m * n}
    return table_finding(
        [
            Row("Analysis-TS", {"N_var": 42, "N_row": 260}, _pair(count(Question("arm2", "I.1", "ts")))),
            Row(
                "Analysis-Reduced",
                {"N_var": 78, "N_row": 60},
                _pair(count(Question("arm2", "I.1", "reduced"))),
                extra,
                f"printed with a symmetric slack matrix ({extra['N_var']}) and one more inequality ({2 * n} rows)",
            ),
            Row("Design-TS", {"N_var": 298, "N_row": 260}, _at("I.2", n, m, 2**5)),
            Row(
                "Design-Reduced",
                {"N_var": 142, "N_row": 60},
                _pair(single_sum(Question("arm2", "I.2", "reduced"))),
                gains,
                f"printed with the same and two more gains ({2 * m * n})",
            ),
        ]
    )


def _table_i5(_: Effort) -> Finding:
    n, m = 6, 3
    reduced = {**_at("I.2", n, m, 13), "vertices": Question("arm3", "I.2", "reduced").model().vertex_count}
    beyond = {"N_var": symmetric(2 * n) + 2 * m * n, "N_row": 2 * n, "vertices": 1}
    return table_finding(
        [
            Row(
                "Design-TS",
                {"N_row": 49158, "N_var": 147549, "vertices": 4096},
                {**_at("I.53", n, m, 2**12), "vertices": Question("arm3", "I.53", "ts").model().vertex_count},
            ),
            Row(
                "Design-Reduced",
                {"N_row": 174, "N_var": 441, "vertices": 14},
                reduced,
                beyond,
                "printed with a symmetric slack matrix, two more gains and one more vertex; its gains are m x n"
                " whereas those of the TS line are the extended ones, m x 2n",
            ),
        ],
        "The headings N_var and N_row of the printed table are swapped",
    )


def _table_ii1(effort: Effort) -> Finding:
    sizes = [(5, 0, r) for r in ((2, 3) if effort is Effort.QUICK else range(2, 7))] + [(3, 2, 3)]
    rows = []
    for n, m, r in sizes:
        five, six = (counted(name, order=n, inputs=m, premises=r) for name in ("II.5", "II.6"))
        full = 2 * r * (4 * n * n - symmetric(2 * n))
        at = f"n = {n}, m = {m}, r = {r}"
        rows += [
            Row(f"Theorem II.5, {at}", {"N_row": n * (16 * r**2 + 1), "N_var": _ii5_var(n, m, r)}, _pair(five)),
            Row(
                f"Theorem II.6, {at}",
                {"N_row": n * (8 * r**2 + 1), "N_var": _ii6_var(n, m, r)},
                _pair(six),
                {"N_var": full},
                f"printed with slack matrices as full, not symmetric ({full} unknowns more)",
            ),
        ]
    return table_finding(rows)


def _ii5_var(n: int, m: int, r: int) -> int:
    """Table II.1, printed."""
    return (n * n * (16 * r * r + 64 * r + 1) + n * (1 + 8 * r)) // 2 + 2 * r * m * n


def _ii6_var(n: int, m: int, r: int) -> int:
    """Table II.1, printed."""
    return (n * n * (24 * r + 1) + n) // 2 + 2 * r * m * n


def _table_ii2(_: Effort) -> Finding:
    five, corollary = Question("ex-II.7", "II.5"), Question("ex-II.7", "II.5-cor1")
    return table_finding(
        [
            Row("Theorem II.5", {"vertices": 6, "N_row": 362, "N_var": 1185}, _sizes(five)),
            Row("Corollary 1", {"vertices": 6, "N_row": 362, "N_var": 855}, _sizes(corollary)),
        ],
        "The rows printed for He 2021 (408) and Bouarar 2010 (224) do not follow from Table II.1, which gives"
        f" {he_rows(3, 1, 2)} and {bouarar_rows(3, 1, 1, 2)}, but"
        " from n (2^(r + r_a + 2) + 2^r) and (2n + m) 2^(r + r_a):"
        f" {3 * (2**7 + 2**3)} and {(2 * 3 + 1) * 2**5}",
    )


def _table_ii3(_: Effort) -> Finding:
    n, m = 6, 3
    slack = "printed without the slack matrices"
    P2 = 2 * n * n
    return table_finding(
        [
            Row("Theorem II.5", {"N_row": 582, "N_var": 813}, _at("II.5", n, m, 24, common=True), {}, slack),
            Row("Theorem II.6", {"N_row": 294, "N_var": 525}, _at("II.6", n, m, 24, common=True), {}, slack),
            Row(
                "Dehak 2020",
                {"N_row": 162, "N_var": 255},
                _at("I.2", n, m, 13),
                {"N_var": -P2},
                f"printed without P_21 and P_22 ({P2}); Theorem I.2 on r + 1 vertices is taken for it",
            ),
            Row("Tanaka and Wang 2004", {"N_row": 49158, "N_var": 73821}, _at("tanaka-wang", n, m, 2**12)),
        ]
    )


def _table_ii4(_: Effort) -> Finding:
    two, one = 2 * 2, "one scalar inequality"
    pairs = (6 * 6 - 1) * (two + two)
    moving = f"printed without the redundant matrix of P_k = P + tau D_k ({symmetric(2)} unknowns), with {one}"
    positive = f"printed with (II.50a), Z_k + Z_k' > 0, which is wrong; {moving}"
    common = f"printed with one W and Z instead of one per pair ({pairs} unknowns), {one} and Z + Z' > 0, not needed"
    less = -symmetric(2)
    rows = [
        _row_ii4("II.7", (2916, 10326, 82993), sums=4, order=8, beyond=(less, 6 * two + 1), because=positive),
        _row_ii4("II.5", (324, 539, 2313), sums=2, order=8, beyond=(-pairs, two + 1), because=common),
        _row_ii4("II.8", (2430, 4608, 124441), sums=5, order=4, beyond=(less, 1), because=moving),
        _row_ii4("II.6", (90, 153, 581), sums=2, order=4, beyond=(0, 1), because=f"printed with {one}"),
        _row_ii4("guerra-2007", (0, 547, 2053), sums=0, order=4, beyond=(0, 1), because=f"printed with {one}"),
    ]
    return table_finding(
        rows,
        "N_lmi is not a number of inequalities: it is the sum of their squared orders. The slack matrices counted are"
        " indexed by pairs (quadruples, quintuples) of premises, not the T_i + S_j of the theorems",
    )


def _row_ii4(
    name: str, printed: tuple[int, int, int], *, sums: int, order: int, beyond: tuple[int, int], because: str
) -> Row:
    """One line of Table II.4, slack matrices counted from their family without being put in the inequalities.

    Args:
        name: of the condition.
        printed: N_slack, N_var and N_lmi.
        sums: indices of a slack matrix, 0 for none.
        order: of a slack matrix.
        beyond: what the source adds to N_var and N_lmi.
        because: what the differences consist of.
    """
    options = Options(slack=Slack.NONE, window_s=5e-6 if sums > 2 else None)
    question = Question("ex-II.9", name, options=options)
    sizes = count(question)
    blocks = question.model().polytope.block_index if sums else None
    slack = sum(variable.size for variable in slack_family(Slack.PAIRS, name, blocks, order, sums).variables)
    quantities = ("N_slack", "N_var", "N_lmi")
    numbers = {"vertices": 6 if sums else 8, **dict(zip(quantities, printed, strict=True))}
    built = {"vertices": sizes.vertices, "N_slack": slack, "N_var": sizes.unknowns + slack, "N_lmi": sizes.entries}
    return Row(name, numbers, built, dict(zip(quantities[1:], beyond, strict=True)), because)


def _sizes(question: Question) -> dict[str, int]:
    return printed_labels(count(question))


def he_rows(order: int, in_E: int, in_A: int) -> int:
    """He et al. 2021, Theorem 3.3, in Table II.1 as printed."""
    r = in_E + in_A
    return order * ((1 << (r + in_A + 2)) + (1 << r) + (1 << (r + 1)))


def bouarar_rows(order: int, inputs: int, in_E: int, in_A: int) -> int:
    """Bouarar et al. 2010, Theorem 2, in Table II.1 as printed."""
    r = in_E + in_A
    return order * ((1 << (r + in_A + 1)) + (1 << r) + (1 << (r + 1))) + inputs * (1 << (r + in_A + 1))


ITEMS = (
    Item(
        id="table-I.2",
        title="complexity for the 2-DoF arm: TS and reduced representation",
        printed={"N_var": [42, 78, 298, 142], "N_row": [260, 60, 260, 60]},
        assumptions=(SINGLE_SUM, REDUCED_MODEL),
        compute=_table_i2,
    ),
    Item(
        id="table-I.5",
        title="complexity for the 3-DoF arm: TS and reduced representation",
        printed={"N_row": [49158, 174], "N_var": [147549, 441], "vertices": [4096, 14]},
        assumptions=(SINGLE_SUM, REDUCED_MODEL, "the headings N_var and N_row of the printed table are swapped"),
        compute=_table_i5,
    ),
    Item(
        id="table-II.1",
        title="complexity formulas of Theorems II.5 and II.6",
        printed={
            "Theorem II.5": "N_row = n (16 r^2 + 1), N_var = n^2 (8 r^2 + 32 r + 1/2) + n (1/2 + 4 r) + 2 r m n",
            "Theorem II.6": "N_row = n (8 r^2 + 1), N_var = n^2 (12 r + 1/2) + n/2 + 2 r m n",
        },
        assumptions=("the slack matrices of Theorem II.6 are counted as full ones", UNPUBLISHED),
        compute=_table_ii1,
    ),
    Item(
        id="table-II.2",
        title="complexity for Example II.7",
        printed={"Theorem II.5": [6, 362, 1185], "Corollary 1": [6, 362, 855]},
        assumptions=(UNPUBLISHED,),
        compute=_table_ii2,
    ),
    Item(
        id="table-II.3",
        title="complexity for Example II.8, the 3-DoF arm",
        printed={"N_row": [582, 294, 162, 49158], "N_var": [813, 525, 255, 73821]},
        assumptions=(SINGLE_SUM, "slack matrices are left out of N_var, and P_21, P_22 of Dehak 2020", UNPUBLISHED),
        compute=_table_ii3,
    ),
    Item(
        id="table-II.4",
        title="complexity for Example II.9: quadratic and nonquadratic conditions",
        printed={"N_slack": [2916, 324, 2430, 90, 0], "N_var": [10326, 539, 4608, 153, 547]},
        assumptions=("N_lmi is the sum of squared orders plus 1", "W and Z of Theorem II.5 have no index", UNPUBLISHED),
        compute=_table_ii4,
    ),
)
