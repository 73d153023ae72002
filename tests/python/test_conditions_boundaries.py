"""How far conditions reach on the published examples, and how large they are, against independent numbers.

The limits were found with other software (YALMIP and SeDuMi, cvxpy) for the corrected statements, or derived by hand. A
limit is confirmed by a feasible point, proved in exact arithmetic, just inside and an infeasible one just outside.
"""

from dataclasses import dataclass, field

import pytest
from scipy.optimize import brentq

from closed_loops import decided, stated
from quasilpv.conditions.condition import Form, Options
from quasilpv.conditions.forms.slack import Slack
from quasilpv.conditions.registry import condition
from quasilpv.lmi import Outcome
from quasilpv.polytopes import polytopic_model
from random_systems import random_system

FULL = pytest.mark.full


@dataclass(frozen=True)
class Limit:
    """A limit of a condition along one parameter.

    Attributes:
        condition, system, representation: what is asked; no representation is the published one.
        over: the parameter.
        value: the limit, reached from values nearer to zero.
        fixed: the other parameters.
        options: of the condition.
        tolerance: relative; the reference values are rounded.
    """

    condition: str
    system: str
    over: str
    value: float
    representation: str = ""
    fixed: dict[str, float] = field(default_factory=dict)
    options: Options = field(default_factory=Options)
    tolerance: float = 0.01

    def __str__(self) -> str:
        return f"{self.condition} {self.system} {self.options.slack} {self.over}={self.value}"

    def outcome(self, value: float) -> Outcome:
        """The verdict at a value of the parameter."""
        parameters = self.fixed | {self.over: value}
        _, statement = stated(condition(self.condition), self.system, self.options, self.representation, **parameters)
        return decided(statement.problem).outcome


def high_gain_limit(M: float) -> float:
    """The uncertainty c of the spring-disc up to which Theorem I.3 holds for a gain that is large enough.

    With delta = c/2 (1 + D_a) in A and c/2 (1 + D_b) in B, each bounded on its own, and r^2 = J, elimination of lambda
    leaves ``m_0 x_2' = beta u + p_a + p_b + ...``, ``m_0 = 1 + M (1 + c/2)``, ``|p_a| <= (c/2) |lambda|``,
    ``|p_b| <= rho_b beta |u|``, ``rho_b = c/(2 + c)``; a large u leaves ``lambda = M x_2'``, so with y = m_0 x_2'
    ``|p_a| <= rho_a |y|``, ``rho_a = M c/(2 m_0)``. That u y > 0 for all of them follows by the S-procedure,

        2 u' y - s_a (rho_a^2 y^2 - p_a^2) - s_b (rho_b^2 u'^2 - p_b^2) > 0,    u' = beta u,

    for some s > 0: the worst p_a, p_b given y and u' leave ``s (y - u')^2``, ``1/s = 1/s_a + 1/s_b``, and with s = 1
    the cross term vanishes, which leaves ``rho_a^2 < s/s_a``, ``rho_b^2 < s/s_b``: ``rho_a^2 + rho_b^2 < 1``.
    """

    def excess(c: float) -> float:
        return (M * c / (2.0 + 2.0 * M + M * c)) ** 2 + (c / (2.0 + c)) ** 2 - 1.0

    return float(brentq(excess, 1.0, 100.0))


NONE, PAIRS, ALL = (Options(slack=slack) for slack in (Slack.NONE, Slack.PAIRS, Slack.FULL))
RANGE = {"z2_lower": 0.0}

LIMITS = [
    # ex-II.6, a/b for a, b > 0; the exact limit of quadratic stability is 20.
    Limit("I.1", "ex-II.6", "a", 3.99, "reduced"),
    Limit("II.5-cor1", "ex-II.6", "a", 5.98),
    Limit("II.5", "ex-II.6", "a", 20.0),
    Limit("I.1", "ex-II.6", "a", 20.0, "ts"),
    # ex-II.6, a < 0 < b.
    Limit("I.1", "ex-II.6", "a", -0.0238, "reduced"),
    Limit("II.5-cor1", "ex-II.6", "a", -0.0498),
    Limit("II.5", "ex-II.6", "a", -0.1666),
    # ex-I.1 at a = 1.
    Limit("guerra-2007", "ex-I.1", "b", 1.75),
    Limit("II.6", "ex-I.1", "b", 0.73, options=NONE, tolerance=0.015),
    Limit("II.6", "ex-I.1", "b", 2.69),
    Limit("II.6", "ex-I.1", "b", 3.16, options=PAIRS),
    Limit("II.6-direct", "ex-I.1", "b", 2.10, options=PAIRS),
    Limit("I.2", "ex-I.1", "b", 3.07),
    Limit("TS-Pj", "ex-I.1", "b", 3.246),
    pytest.param(Limit("II.5", "ex-I.1", "b", 3.02), marks=FULL),
    pytest.param(Limit("II.5", "ex-I.1", "b", 3.246, options=PAIRS), marks=FULL),
    # ex-I.1 at a = 3 and 6.
    Limit("guerra-2007", "ex-I.1", "b", 0.953, fixed={"a": 3.0}),
    Limit("II.6", "ex-I.1", "b", 1.248, fixed={"a": 3.0}),
    Limit("I.2", "ex-I.1", "b", 1.278, fixed={"a": 3.0}),
    Limit("TS-Pj", "ex-I.1", "b", 1.331, fixed={"a": 3.0}),
    Limit("II.6", "ex-I.1", "b", 0.832, fixed={"a": 6.0}),
    # spring-disc, the largest uncertainty c: where no gain helps. The literature has 6.8, 5.2 and 4.9, cut.
    *(Limit("I.3", "spring-disc", "c", high_gain_limit(M), fixed={"M": M}, tolerance=1e-3) for M in (1.0, 5.0, 15.0)),
    # ex-II.7 and ex-III.11 with z_2 in [0, 1], leftmost a.
    Limit("I.2", "ex-II.7", "a", -12.141, fixed={"b": -27.0} | RANGE),
    Limit("TS-Pj", "ex-II.7", "a", -12.92, fixed={"b": -27.0} | RANGE),
    Limit("I.3", "ex-III.11", "a", -11.47, fixed={"b": -25.0} | RANGE),
    pytest.param(Limit("III.9", "ex-III.11", "a", -11.75, fixed={"b": -25.0} | RANGE), marks=FULL),
]


@pytest.mark.parametrize("limit", LIMITS, ids=str)
def test_a_condition_reaches_its_limit_and_not_further(limit: Limit) -> None:
    assert limit.outcome(limit.value * (1.0 - limit.tolerance)) is Outcome.VERIFIED
    assert limit.outcome(limit.value * (1.0 + limit.tolerance)) is Outcome.INFEASIBLE_NUMERICALLY


def test_a_light_spring_disc_is_stabilised_beyond_by_its_own_damper() -> None:
    """M = 0.1: the literature has 17.6, more than a large gain reaches; c = 17.6 is proved."""
    assert high_gain_limit(0.1) < 17.5
    assert Limit("I.3", "spring-disc", "c", 17.6, fixed={"M": 0.1}).outcome(17.6) is Outcome.VERIFIED


def test_full_slack_reaches_beyond_slack_per_pair_of_blocks() -> None:
    """b = 3.2 is out of reach of T_bc (limit 3.16) and proved with T_i,b: the families are not equivalent."""
    limits = [Limit("II.6", "ex-I.1", "b", 3.2, options=options) for options in (PAIRS, ALL)]
    pairs, full = (limit.outcome(limit.value) for limit in limits)
    assert (pairs, full) == (Outcome.INFEASIBLE_NUMERICALLY, Outcome.VERIFIED)


@FULL
def test_a_lyapunov_function_with_memory_adds_nothing_over_its_quadratic_part() -> None:
    """The limit of Theorem II.8 for tau -> 0 lies where that of Theorem II.6 does, 2.6995, up to 1 %."""
    limit = Limit("II.8", "ex-I.1", "b", 2.66)
    assert limit.outcome(2.60) is Outcome.VERIFIED
    assert limit.outcome(2.72) is Outcome.INFEASIBLE_NUMERICALLY


@FULL
def test_unknown_premises_as_blocks_reach_further_than_as_norm_bounded_uncertainty() -> None:
    assert Limit("III.9", "spring-disc", "c", 60.0).outcome(60.0) is Outcome.VERIFIED
    assert Limit("I.3", "spring-disc", "c", 60.0).outcome(60.0) is Outcome.INFEASIBLE_NUMERICALLY


@FULL
def test_theorem_ii5_reaches_further_than_i2_on_all_vertices_when_w_and_z_have_two_indices() -> None:
    """ex-II.7, z_2 in [0, 1], b = -27: II.5 proves a = -12.9, I.2 ends at -12.17."""
    fixed = {"b": -27.0} | RANGE
    assert Limit("II.5", "ex-II.7", "a", -12.9, fixed=fixed).outcome(-12.9) is Outcome.VERIFIED
    assert Limit("I.2", "ex-II.7", "a", -12.9, fixed=fixed).outcome(-12.9) is Outcome.INFEASIBLE_NUMERICALLY


# ---- sizes -----------------------------------------------------------------------------------------------------------

PUBLISHED = Options(form=Form.PUBLISHED)


@dataclass(frozen=True)
class Size:
    """Published size of a condition: scalar unknowns, rows of all inequalities, unknowns in slack matrices."""

    condition: str
    system: str
    representation: str
    options: Options
    unknowns: int
    rows: int
    slack: int = 0


COMMON = Options(form=Form.PUBLISHED, common=True)
PER_PAIR = Options(form=Form.PUBLISHED, slack=Slack.PAIRS)

SIZES = [
    Size("I.1", "arm2", "ts", PUBLISHED, 42, 260),  # Table I.2
    Size("I.2", "arm2", "ts", PUBLISHED, 298, 260),  # Table I.2
    Size("II.5", "ex-II.7", "per-premise@0", PUBLISHED, 1185, 362, 330),  # Table II.2
    Size("II.5-cor1", "ex-II.7", "per-premise@0", PUBLISHED, 855, 362),  # Table II.2
    Size("II.5", "arm3", "per-premise@0", COMMON, 813 + 3600, 582, 3600),  # Table II.3, which omits the slack
    Size("II.6", "ex-I.1", "per-premise@0", PER_PAIR, 153, 146, 90),  # Table II.4
    Size("guerra-2007", "ex-I.1", "ts", PUBLISHED, 547, 514),  # Table II.4
]


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size.condition} {size.system}")
def test_published_forms_have_the_published_sizes(size: Size) -> None:
    _, statement = stated(condition(size.condition), size.system, size.options, size.representation)
    assert sum(variable.size for variable in statement.problem.variables) == size.unknowns
    assert sum(constraint.expression.shape[0] for constraint in statement.problem.constraints) == size.rows
    assert sum(variable.size for variable in statement.slacks) == size.slack


@pytest.mark.parametrize("premises", [1, 2, 3])
def test_sizes_follow_the_published_formulas(premises: int) -> None:
    """Dehak 2022, Table II.1, with symmetric slack matrices in II.6: 8 r + 1/2 and 2 r instead of 12 r."""
    r, n, m = premises, 2, 1
    plant = random_system(0, premises=r, constant_input=False)
    model = polytopic_model(plant, "per-premise")
    slack = 0 if r == 1 else 1  # a single block has none
    for name, slack_free, slack_size in (
        ("II.5", 8 * r**2 * n**2 + n**2 / 2 + n / 2 + 16 * r * n**2 + 2 * r * m * n, r * 4 * n * (4 * n + 1)),
        ("II.6", n**2 / 2 + n / 2 + 4 * r * n**2 + 2 * r * m * n, r * 2 * n * (2 * n + 1)),
    ):
        problem = condition(name).build(model, PUBLISHED).problem
        assert sum(variable.size for variable in problem.variables) == slack_free + slack * slack_size
        rows = n * (16 * r**2 + 1) if name == "II.5" else n * (8 * r**2 + 1)
        assert sum(constraint.expression.shape[0] for constraint in problem.constraints) == rows


def test_three_joint_arm_with_all_4096_vertices_is_decided_in_a_fraction_of_a_minute() -> None:
    """Theorem I.2 on the 4096 vertices of arm3 is eight inequalities in the inertia and one without premises."""
    _, statement = stated(condition("I.2"), "arm3", Options(), theta_max=0.5)
    assert len(statement.problem.constraints) == 1 + 1 + 8
    assert decided(statement.problem).feasible
    _, outside = stated(condition("I.2"), "arm3", Options(), theta_max=1.5)
    assert decided(outside.problem).outcome is Outcome.INFEASIBLE_NUMERICALLY
