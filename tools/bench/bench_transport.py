"""Round trip of measurement and command in lock-step: LCM between two processes, queues between two threads."""

from __future__ import annotations

from functools import partial

from bench_programs import costs, run_in_turns, run_program
from bench_report import Report, main, row

URL = "udpm://239.255.76.67:7691?ttl=0"  # a port of its own: no other run is disturbed or listened to
QUANTILES = {"p50": "p50_ns", "p99": "p99_ns", "p99.9": "p999_ns"}


def measure(quick: bool) -> Report:
    """Time the round trips of both links."""
    runs = {"link": partial(run_program, "transport_bench", URL, 200 if quick else 4000)}
    measured = run_in_turns(runs, quick=quick)["link"]
    rows = []
    for name, key, other, other_key in (
        ("LCM", "lcm", "in-process", "in_process"),
        ("in-process", "in_process", "LCM", "lcm"),
    ):
        rows += [
            row(
                f"{name} round trip {label}",
                costs(measured, key, quantile, scale=1e-3),
                "us",
                (f"{other} round trip {label}", costs(measured, other_key, quantile, scale=1e-3)),
            )
            for label, quantile in QUANTILES.items()
        ]
    median_us = costs(measured, "in_process", "p50_ns", scale=1e-3)
    for name, key in (("tag of a measurement made", "sign"), ("tag of a measurement checked", "check")):
        tag_us = costs(measured, "authentication", key, "batch_ns", scale=1e-3)
        rows.append(row(name, tag_us, "us", ("in-process round trip p50", median_us)))
    notes = [
        f"authenticated mode: {measured[0]['authentication']['bytes']} bytes and their tag, CPU time per message, "
        "warm; a command is shorter",
        f"{sum(costs(measured, 'samples')):.0f} round trips each, normal scheduling; measurements sent again: "
        f"{sum(costs(measured, 'lcm', 'repeated')):.0f} over LCM, "
        f"{sum(costs(measured, 'in_process', 'repeated')):.0f} in process",
    ]
    return Report(rows, notes)


if __name__ == "__main__":
    main("transport", "Lock-step round trips over LCM and over the in-process link.", measure)
