"""Scenarios: an experiment the simulator can run, true plant included (``docs/reference/formats.md``).

Five parts: the documents (`schema`; `system_schema` of general systems), what is tracked by which robot (`experiment`),
the experiments known by name (`registry`), and the way from a robot and a reference to a document (`builder`). Encoders
have 20 bits; the measured speed, which only the baseline laws read, carries white noise.
"""

from quasilpv.scenarios.builder import build_scenario
from quasilpv.scenarios.experiment import TrackingExperiment
from quasilpv.scenarios.registry import EXTERNAL_TORQUE, motions_of, tracking_experiment, tracking_experiments
from quasilpv.scenarios.schema import (
    NOISE_SEED,
    OPTIONAL,
    VELOCITY_NOISE_RAD_S,
    IdaIntegrator,
    InitialState,
    Integrator,
    MujocoIntegrator,
    Rk4Integrator,
    Scenario,
    Sensors,
    SineTorque,
    read_scenario,
    sine_torques,
    write_scenario,
)
from quasilpv.scenarios.system_schema import SystemScenario, write_system_scenario

__all__ = [
    "EXTERNAL_TORQUE",
    "NOISE_SEED",
    "OPTIONAL",
    "VELOCITY_NOISE_RAD_S",
    "IdaIntegrator",
    "InitialState",
    "Integrator",
    "MujocoIntegrator",
    "Rk4Integrator",
    "Scenario",
    "Sensors",
    "SineTorque",
    "SystemScenario",
    "TrackingExperiment",
    "build_scenario",
    "motions_of",
    "read_scenario",
    "sine_torques",
    "tracking_experiment",
    "tracking_experiments",
    "write_scenario",
    "write_system_scenario",
]
