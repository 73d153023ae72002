"""Round trip of measurement and command in lock-step: LCM between two processes, queues between two threads."""

from __future__ import annotations

from bench_programs import run_program
from bench_report import Report, main, row

URL = "udpm://239.255.76.67:7691?ttl=0"  # a port of its own: no other run is disturbed or listened to
QUANTILES = {"p50": "p50_ns", "p99": "p99_ns", "p99.9": "p999_ns"}


def measure(quick: bool) -> Report:
    """Time the round trips of both links."""
    result = run_program("transport_bench", URL, 200 if quick else 20_000)
    rows = []
    for name, key, other, other_key in (
        ("LCM", "lcm", "in-process", "in_process"),
        ("in-process", "in_process", "LCM", "lcm"),
    ):
        rows += [
            row(
                f"{name} round trip {label}",
                result[key][quantile] * 1e-3,
                "us",
                (f"{other} round trip {label}", result[other_key][quantile] * 1e-3),
            )
            for label, quantile in QUANTILES.items()
        ]
    authentication = result["authentication"]
    for name, key in (("tag of a measurement made", "sign"), ("tag of a measurement checked", "check")):
        against = ("in-process round trip p50", result["in_process"]["p50_ns"] * 1e-3)
        rows.append(row(name, authentication[key]["batch_ns"] * 1e-3, "us", against))
    notes = [
        f"authenticated mode: {authentication['bytes']} bytes and their tag, CPU time per message, warm; a command is "
        "shorter",
        f"{result['samples']} round trips each, normal scheduling; measurements sent again: "
        f"{result['lcm']['repeated']} over LCM, {result['in_process']['repeated']} in process",
    ]
    return Report(rows, notes)


if __name__ == "__main__":
    main("transport", "Lock-step round trips over LCM and over the in-process link.", measure)
