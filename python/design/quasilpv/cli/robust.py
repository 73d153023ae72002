"""``design robust``: the robust gate; a proof for every posture, payload and small delay, or a grid check."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from quasilpv.cli.console import JsonOption, print_json, print_note, print_table
from quasilpv.cli.options import FormatOption, formats_of
from quasilpv.cli.robust_system import check_system
from quasilpv.cli.system_options import DelayOption
from quasilpv.errors import InputError
from quasilpv.files import claim_folder

if TYPE_CHECKING:
    from quasilpv.certificate import Gate
    from quasilpv.certificate.gate.elastic import ElasticGate
    from quasilpv.certificate.gate.elastic_grid import ElasticGridGate
    from quasilpv.certificate.gate.grid import GridGate
    from quasilpv.certificate.gate.proof import RobustGate

MARGIN_FIGURE, GROWTH_FIGURE, DISTANCE_FIGURE = "inertia-margin", "growth-rate", "distance"
WHILE = "while no torque or slew limit acts"


def robust_command(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="File, JSON or CBOR twin.")],
    *,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="DIR", help="Draw what the gate found into this folder."),
    ] = None,
    figure_formats: FormatOption = None,
    delay_s: DelayOption = None,
    json: JsonOption = False,
) -> int:
    """Ask whether the frozen loop is stable in every posture, with every payload, with up to half a sample of delay.

    For dob-acceleration and motor-pid the answer is a proof; for torque-level laws, and for laws of elastic joints
    that are not proved, it is a check on a grid, and says so. Exit code 1 if the gate is not passed. It reads nothing
    but the artifact.

    Of a controller of a system: its exact plant over one sample from 2000 points of the region, worst ones climbed
    from; sampled, no proof. With --delay, which no proof covers, in the mean over some samples. If it has parameters,
    how far their intervals can grow: proved to, refuted at, unknown between.

    \b
    Examples:
      design robust out/arm3/artifact.json -o out/arm3
      design robust out/cart_pole/artifact.json --delay 0.0005 -o out/cart_pole
    """
    from quasilpv.artifact.system_store import read_system_artifact

    system = read_system_artifact(artifact)
    if system is not None:
        return check_system(system, str(artifact), delay_s or 0.0, out, formats_of(figure_formats), json=json)
    if delay_s is not None:
        raise InputError("command line", "--delay", delay_s, "nothing: the delay of a robot is in its artifact")
    from quasilpv.artifact import read_artifact
    from quasilpv.certificate import gate
    from quasilpv.certificate.gate.proof import RobustGate

    formats = formats_of(figure_formats)
    if out is not None:
        claim_folder(out)
    found = gate(read_artifact(artifact).content(), str(artifact))
    if json:
        print_json(found.timed_document() if isinstance(found, RobustGate) else found.to_document())
    else:
        rows, verdict = _answer(found)
        print_table(str(artifact), ("", ""), [*rows, ("evidence", found.evidence.value)], left_columns=2)
        print(verdict)
    if out is not None:
        for path in _draw(found, out, formats):
            print_note(f"wrote {path}")
    return 0 if found.passed else 1


def _answer(found: Gate) -> tuple[list[tuple[str, str]], str]:
    """Rows and verdict of any gate."""
    from quasilpv.certificate.gate.elastic import ElasticGate
    from quasilpv.certificate.gate.elastic_grid import ElasticGridGate
    from quasilpv.certificate.gate.proof import RobustGate

    if isinstance(found, ElasticGate):
        return _elastic_answer(found)
    if isinstance(found, ElasticGridGate):
        return _elastic_grid_answer(found)
    return (_rows(found), _verdict(found)) if isinstance(found, RobustGate) else _grid_answer(found)


def _elastic_answer(found: ElasticGate) -> tuple[list[tuple[str, str]], str]:
    """Rows and verdict of the gate of elastic joints."""
    from quasilpv.certificate.exact.rationals import to_float
    from quasilpv.certificate.gate.elastic import WHAT

    delay = f"{to_float(found.specified_delay_samples):g} samples of delay"
    rows = [
        ("links over rotors (proved)", _interval(*found.links.needed.to_floats()) if found.links.needed else "none")
    ]
    rows.append(("  found at samples", _interval(*found.links.sampled)))
    plants, exclusion = found.plants, found.exclusion
    if plants is not None and exclusion is not None:
        period = found.loop.sample_period_s
        low, high = (to_float(end) * period for end in plants.dampings)
        rows += [
            ("damping over stiffness", f"{_interval(1e3 * low, 1e3 * high)} ms"),
            ("a member of the set", "stable" if exclusion.anchored else "not proved stable"),
            ("cells of frequency, delay and lag", f"{exclusion.cells}"),
        ]
    if found.passed:
        return rows, f"passed: {WHAT}: proved for every posture, load, gear and constant delay up to {delay}, {WHILE}"
    return rows, f"NOT passed: {found.why_not_passed().removeprefix('robust gate: ')}"


def _elastic_grid_answer(found: ElasticGridGate) -> tuple[list[tuple[str, str]], str]:
    """Rows and verdict of a grid of elastic arms."""
    from quasilpv.certificate.gate.elastic_grid import LABEL

    worst = found.worst
    rows = [
        ("worst growth rate", f"{worst.growth_rate_per_s:.3g} 1/s"),
        ("  at joint angles", f"{', '.join(f'{angle:.3g}' for angle in worst.angle_rad)} rad"),
        ("  with", f"{'the largest load' if worst.loaded else 'no load'}, the {worst.gears} gears"),
        ("  and a delay and lag of", f"{worst.delay_s * 1e3:.3g} ms, {worst.lag_s * 1e3:.3g} ms"),
        ("loops", f"{len(found.loops)}"),
    ]
    if found.passed:
        return rows, f"passed: {LABEL}: stable at every point of the grid (frozen loop), {WHILE}; not a proof"
    return rows, f"NOT passed: {LABEL}: a loop of the grid is not stable"


def _draw(found: Gate, out: Path, formats: Sequence[str]) -> list[Path]:
    """The figure of a gate."""
    from quasilpv.certificate.gate.elastic import ElasticGate
    from quasilpv.certificate.gate.elastic_grid import ElasticGridGate
    from quasilpv.certificate.gate.grid import GridGate
    from quasilpv.figures.gate import gate_figure
    from quasilpv.figures.style import save

    name = GROWTH_FIGURE if isinstance(found, GridGate | ElasticGridGate) else MARGIN_FIGURE
    if isinstance(found, ElasticGate):
        name = DISTANCE_FIGURE
    return save(gate_figure(found), out / name, formats)


def _grid_answer(found: GridGate) -> tuple[list[tuple[str, str]], str]:
    """Rows and verdict of a grid check."""
    period = found.plants.law.sample_period_s
    delay = found.specified_delay_s / period
    (worst, worst_delay_s), margin = found.worst_case, found.delay_margin_s
    angles = ", ".join(f"{angle:.3g}" for angle in worst.angle_rad)
    rows = [
        ("worst growth rate", f"{worst.growth_rate_per_s:.3g} 1/s"),
        ("  at joint angles", f"{angles} rad"),
        ("  with payload fraction", f"{worst.payload_fraction:.3g}"),
        ("  and a delay of", f"{worst_delay_s * 1e3:.3g} ms"),
        ("delay margin", "none" if margin is None else f"{margin * 1e3:.4g} ms = {margin / period:.3g} samples"),
        (f"factors on the true inertia with {delay:g} samples of delay", _interval(*found.factors or (0.0, 0.0))),
        (f"inertia margin for M_t = rho M_n with {delay:g} samples of delay", _interval(*found.margin or (0.0, 0.0))),
        ("needed range of M_t/M_n (proved)", _interval(*found.needed.to_floats()) if found.needed else "none"),
        ("loops", f"{len(found.plants)} ({len(found.plants.angles)} postures, {len(found.plants.inertia)} payloads)"),
    ]
    if found.passed:
        return rows, f"passed: stable at every point of the grid (frozen loop), {WHILE}; a grid check, not a proof"
    return rows, "NOT passed: a loop of the grid is not stable up to the specified delay"


def _rows(gate: RobustGate) -> list[tuple[str, str]]:
    """What a person wants to know, one line each."""
    from quasilpv.certificate.exact.rationals import to_float

    margin = _interval(*gate.margin.to_floats()) if gate.margin else "none"
    needed = _interval(*gate.needed.to_floats()) if gate.needed else "none"
    lags = f" and {gate.lag_s[1] * 1e3:.3g} ms of lag" if gate.lag[1] > 0 else ""
    rows = [
        (f"inertia margin with {to_float(gate.specified_delay_samples):g} samples of delay{lags}", margin),
        ("needed range of M_t/M_n (proved)", needed),
        ("  found at samples", _interval(*gate.sampled_range) if gate.sampled_range else "none"),
        ("delay margin" + (f" at every lag of {_lags(gate)}" if lags else ""), _delay(gate)),
        (
            "one Lyapunov function for all motions",
            {None: "not claimed", True: "proved", False: "NOT proved"}[gate.motion],
        ),
        *_condition(gate),
    ]
    if gate.elastic is not None:
        rows.append(("elastic arms beside it (numerical, grid)", f"{gate.elastic.worst.growth_rate_per_s:.3g} 1/s"))
    if gate.worst is not None:
        place = gate.worst.place
        angles = ", ".join(f"{angle:.3g}" for angle in place.angle_rad)
        rows += [
            ("worst growth rate (numerical)", f"{gate.worst.growth_rate_per_s:.3g} 1/s"),
            ("  at joint angles", f"{angles} rad"),
            ("  with payload fraction", f"{place.payload_fraction:.3g} (M_t/M_n {place.inertia_ratio:.4g})"),
            ("  and a delay of", f"{gate.worst.delay_s * 1e3:.3g} ms"),
        ]
        if lags:
            rows.append(("  and a lag of", f"{gate.worst.lag_s * 1e3:.3g} ms"))
    return rows


def _condition(gate: RobustGate) -> list[tuple[str, str]]:
    """Within which motions, if not for all."""
    if gate.condition is None:
        return []
    limits = gate.condition.limits
    return [
        ("  for angles in", ", ".join(_interval(*interval) for interval in limits.angle_rad) + " rad"),
        ("  and speeds up to", ", ".join(f"{speed:.3g}" for speed in limits.speed_rad_s) + " rad/s"),
        ("  rate of the inertia", f"at most {gate.condition.rate_per_s:.3g} 1/s"),
    ]


def _lags(gate: RobustGate) -> str:
    low, high = gate.lag_s
    return f"{low * 1e3:.3g} to {high * 1e3:.3g} ms"


def _interval(low: float, high: float | None) -> str:
    return f"[{low:.4g}, {'infinity' if high is None else f'{high:.4g}'}]"


def _delay(gate: RobustGate) -> str:
    if gate.delay_margin_s is None:
        return "none"
    return f"{gate.delay_margin_s * 1e3:.4g} ms = {gate.delay_margin_s / gate.loop.sample_period_s:.3g} samples"


def _verdict(gate: RobustGate) -> str:
    from quasilpv.certificate.gate.proof import ON_CONDITION

    if not gate.passed:
        return f"NOT passed: {_refusal(gate)}"
    if gate.motion:
        within = "" if gate.condition is None else " within these angles and speeds"
        return f"passed: proved for every motion{within}, payload and constant delay up to the specified one, {WHILE}"
    lag = f", every lag of the drives of {_lags(gate)}" if gate.lag[1] > 0 else ""
    proved = f"every posture, payload{lag} and constant delay up to the specified one (frozen loop)"
    on = f", on condition that {ON_CONDITION}" if gate.torque_controlled else ""
    return f"passed: proved for {proved}, {WHILE}{on}"


def _refusal(gate: RobustGate) -> str:
    if gate.motion is False:
        return "that one Lyapunov function is common to all motions is claimed and not proved"
    if gate.elastic is not None and not gate.elastic.passed:
        return "gears give, and a loop of the grid of elastic arms is not stable (numerical)"
    if gate.margin is None:
        return "with the specified delay the loop is not stable even with the design inertia"
    if gate.needed is None:
        return "no range of inertia ratios could be proved over the operating domain"
    return "the needed range does not lie inside the inertia margin up to the specified delay"
