"""What verbs do with general systems: ``synth``, ``verify`` and ``inspect`` hand over to this module."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from quasilpv.cli.console import print_note, print_table
from quasilpv.cli.usage import NUMBER_EXPECTED, number
from quasilpv.errors import InputError


def names_a_system(text: str) -> bool:
    """Whether what is to be designed for is a general system; a robot of the same name comes first."""
    if text.endswith((".json", ".py")) or ".py:" in text:
        return True
    from quasilpv.systems.catalogue import system_names
    from quasilpv.systems.robots.registry import all_robots

    return text in system_names() and text not in {robot.id for robot in all_robots()}


def numbers_by_name(option: str, texts: Sequence[str] | None) -> dict[str, float]:
    """``NAME=NUMBER`` as often as given.

    Raises:
        InputError: not of that form, or a name twice.
    """
    found: dict[str, float] = {}
    for text in texts or ():
        name, _, typed = text.partition("=")
        value = number(typed)
        if value is None or not name:
            raise InputError("command line", option, text, f"NAME=VALUE, {NUMBER_EXPECTED}")
        if name in found:
            raise InputError("command line", option, f"{name} twice", "each name once")
        found[name] = value
    return found


def premise_fault_of(policy: str | None) -> dict[str, float | None]:
    """``--premise-policy`` as what a request says of it; nothing of nothing.

    Raises:
        InputError: it is none.
    """
    named = {"clamp": None, "fault": 0.0}
    if policy is None:
        return {}
    value = named[policy] if policy in named else number(policy)
    if policy not in named and (value is None or value < 0.0):
        raise InputError("command line", "--premise-policy", policy, "clamp, fault, or a time >= 0, s")
    return {"premise_fault_s": value}


def write_system(
    reference: str, out: Path | None, *, parameters: Mapping[str, float], allow_unproved_rate: bool, **wanted: Any
) -> dict[str, Any]:
    """Design, check and write a controller of a system; what --json prints.

    Raises:
        InputError, InfeasibleError, ClaimError: see `quasilpv.system_release.release_system`.
    """
    from quasilpv.artifact.system_store import system_summary, write_system_artifact
    from quasilpv.cli.console import progress
    from quasilpv.files import claim_folder
    from quasilpv.synthesis.regional.request import RegionalRequest
    from quasilpv.system_release import release_system
    from quasilpv.systems.catalogue import system_kind

    kind = system_kind(reference)
    system = kind.system(**parameters)
    request = RegionalRequest(system, **wanted)
    folder = out or Path("out") / kind.stem
    claim_folder(folder)
    with progress(1) as steps:
        steps.begin(f"a feedback and its region for {system.name}")
        artifact = release_system(request, allow_unproved_rate=allow_unproved_rate, progress=steps.parts)
        steps.end()
    paths = write_system_artifact(folder, artifact)
    return {"artifact": {path.suffix.removeprefix("."): str(path) for path in paths}, **system_summary(artifact)}


def print_system(answer: Mapping[str, Any]) -> None:
    """What `write_system` found, for people."""
    reach = ", ".join(f"|{name}| < {value:.4g}" for name, value in answer["region_reach"].items())
    sampling = answer["sampling"]
    proved = sampling if isinstance(sampling, str) else "proved"
    if isinstance(sampling, Mapping) and "longest_period_s" in sampling:
        proved += f"; up to {sampling['longest_period_s']:.4g} s would be"
    certificate = answer["verification"]["certificate"]
    evidence = ", ".join(f"{count} {kind}" for kind, count in certificate["evidence"].items() if count)
    rows = [
        ("law", answer["law"]),
        ("region reaches", reach),
        *_observer(answer),
        ("decay rate", f"{answer['decay_rate_per_s']:.4g} 1/s"),
        ("largest gain", f"{answer['largest_gain']:.4g}"),
        *_performance(answer),
        *((f"input {name}", text) for name, text in answer["inputs"].items()),
        *((f"assumed of {name}", text) for name, text in answer["parameters"].items()),
        *(("assumed", text) for text in answer["verification"]["assumed"]),
        ("sampling period", f"{answer['sample_period_s']:.4g} s, {proved}"),
        ("certificate", f"{certificate['lmis']} inequalities hold: {evidence}"),
    ]
    print_table(answer["name"], ("", ""), rows, left_columns=2)
    for path in answer["artifact"].values():
        print_note(f"wrote {path}")


def _observer(answer: Mapping[str, Any]) -> list[tuple[str, str]]:
    if "observer" not in answer:
        return []
    own = answer["observer"]
    alone = ", ".join(f"|{name}| < {value:.4g}" for name, value in own["largest_error"].items())
    start = ", ".join(f"{name} {value:.4g}" for name, value in own["start"].items())
    return [
        ("measured", ", ".join(own["measured"])),
        ("estimated", f"{', '.join(own['start'])}; at first {start}"),
        ("errors allowed", f"{alone}, at the trim; in all sqrt(V) + {own['weight']:.4g} |e| < 1"),
    ]


def _performance(answer: Mapping[str, Any]) -> list[tuple[str, str]]:
    if "l2_gain" not in answer:
        return []
    energy = f"{answer['energy_s']:.4g} s"
    return [("L2 gain", f"{answer['l2_gain']:.4g} before sampling, of disturbances of energy up to {energy} from rest")]
