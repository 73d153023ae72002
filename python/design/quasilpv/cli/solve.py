"""``design solve``: one condition at one parameter point."""

from __future__ import annotations

from quasilpv.cli.console import JsonOption, print_json
from quasilpv.cli.parameters import (
    CommonOption,
    ConditionOption,
    DecayOption,
    FormOption,
    RepresentationOption,
    SampleOption,
    SetOption,
    SlackOption,
    SystemArgument,
    WindowOption,
    question,
)
from quasilpv.conditions.blocks import Slack
from quasilpv.conditions.condition import Form, Options
from quasilpv.studies import Answer, Sweep, Verdict
from quasilpv.studies.question import largest_or_reached_margin


def solve_command(
    system: SystemArgument,
    *,
    condition: ConditionOption,
    representation: RepresentationOption = "",
    slack: SlackOption = Slack.THESIS,
    parameters: SetOption = None,
    decay: DecayOption = 0.0,
    form: FormOption = Form.REDUCED,
    common: CommonOption = False,
    window_s: WindowOption = None,
    sample_period_s: SampleOption = Options.sample_period_s,
    json: JsonOption = False,
) -> int:
    """Decide whether a condition holds for a system: feasible with a proof, infeasible numerically, or unknown.

    Exit code 0 if feasible, 1 otherwise.

    \b
    Examples:
      design solve ex-I.1 --condition II.6 --set a=1 --set b=2.5
      design solve ex-I.1 --condition II.6 --set b=3 --slack full --json
    """
    options = Options(slack, decay, form, window_s=window_s, common=common, sample_period_s=sample_period_s)
    asked = question(system, condition, representation, parameters, options)
    answer = Sweep(asked, ()).at({})
    margin = largest_or_reached_margin(asked, answer)
    if json:
        print_json(
            {
                "verdict": answer.verdict.value,
                "certified": answer.certified,
                "margin": margin,
                "unknowns": answer.unknowns,
                "rows": answer.rows,
                "seconds": answer.seconds,
            }
        )
    else:
        print(_sentence(answer))
        shown = "unknown" if margin is None else f"{margin:.3g}"
        print(f"margin {shown}, {answer.unknowns} unknowns, {answer.rows} rows, {answer.seconds:.3f} s")
    return 0 if answer.verdict is Verdict.FEASIBLE else 1


def _sentence(answer: Answer) -> str:
    if answer.certified:
        return "feasible: a solution satisfies every inequality, checked in exact arithmetic"
    if answer.verdict is Verdict.INFEASIBLE:
        sure = f", none of norm below {answer.excluded_norm:.1e}" if answer.excluded_norm else ""
        return f"infeasible: the solver found no solution{sure} (numerical, not a proof)"
    return "unknown: the solver came to no conclusion"
