"""What a failed run in two processes says: which fault, when, and numbers of the samples before it only."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.arrays import FloatArray
from quasilpv.experiments.fault import NUMBERS, Fault, fault_of
from quasilpv.telemetry.codes import FAULT, FAULT_CAUSES, RUNNING
from reference.runs import synthetic_run

T = 1e-3
SAID = "qlpv-controller: fault stop: plant silent, last sample 2999"


def controller(samples: int, latched: int | None = None) -> dict[str, FloatArray]:
    """The record of a controller that latches a fault at a sample."""
    seq = np.arange(float(samples))
    state = np.full(samples, float(RUNNING))
    state[samples if latched is None else latched :] = FAULT
    return {"seq": seq, "state": state}


def plant(samples: int, commands: int) -> dict[str, FloatArray]:
    """The record of a plant that hears so many commands and then none."""
    delay = np.full(samples, -1.0)
    delay[:commands] = 1e-4
    return {"seq": np.arange(float(samples)), "command_delay_s": delay}


def test_when_the_run_went_on_after_the_fault_expect_the_time_of_the_fault_not_of_the_end() -> None:
    post_mortem = {"cause": "plant silent", "seq": list(range(1793, 1843))}
    for report in ({"post_mortem": post_mortem}, {"post_mortem": None, "fault_cause": "plant silent"}):
        stop = fault_of(SAID, report, controller(3000, latched=1842), plant(3000, 3000), T)
        assert stop == Fault("plant silent", 1842, pytest.approx(1.842))
        assert str(stop) == "fault F2 at 1.842 s: plant silent"


def test_when_only_the_plant_knows_expect_the_first_sample_without_a_command() -> None:
    said = "qlpv-simulator: fault stop: controller silent, braked by the watchdog, last sample 3000"
    report = {"post_mortem": None, "fault_cause": "none"}
    stop = fault_of(said, report, controller(700), plant(3000, 700), T)
    assert str(stop) == "fault F7 at 0.700 s: controller silent, braked by the watchdog"
    assert fault_of(said, report, controller(0), plant(3000, 0), T).sample == 0


def test_every_cause_that_the_controller_names_has_the_number_of_its_fault() -> None:
    named = [cause for cause in FAULT_CAUSES if cause not in ("", "stop requested")]
    unnumbered = [cause for cause in named if not any(cause.startswith(words) for words in NUMBERS)]
    assert unnumbered == []


@given(st.integers(1, 30), st.integers(0, 40))
def test_a_run_until_a_sample_is_what_was_before_it(samples: int, sample: int) -> None:
    run = synthetic_run(samples, 2)
    part = run.until(sample)
    for field in fields(run):
        whole = getattr(run, field.name)
        if field.name == "sample_period_s":
            assert part.sample_period_s == whole
        else:
            np.testing.assert_array_equal(getattr(part, field.name), whole[: min(sample, samples)])
