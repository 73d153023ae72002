"""From a robot and a reference to the experiment the simulator runs."""

from __future__ import annotations

from typing import Literal

from quasilpv.errors import InputError
from quasilpv.scenarios.schema import IdaIntegrator, Integrator, MujocoIntegrator, Scenario, Sensors, SineTorque, Vector
from quasilpv.systems.robots.registry import AnyRobot
from quasilpv.trajectories import Trajectory


def build_scenario(
    robot: AnyRobot,
    trajectory: Trajectory,
    *,
    plant: Literal["nominal", "perturbed", "mujoco"] = "perturbed",
    sensors: Sensors | None = None,
    integrator: Integrator | None = None,
    external_torque: tuple[SineTorque, ...] = (),
    transport_delay_s: float = 0.0,
    initial_angle_rad: Vector | None = None,
    initial_speed_rad_s: Vector | None = None,
    torque_limit_nm: Vector | None = None,
) -> Scenario:
    """Return the experiment in which ``robot`` tracks ``trajectory``.

    Args:
        robot: what the controller was designed for.
        trajectory: the reference; gives the name, the duration and the state at t = 0.
        plant: the true plant, the nominal robot or the robot with its full payload (moments of inertia about the
            centres of mass unchanged); ``"mujoco"``: the latter, moved by MuJoCo.
        sensors: default ``Sensors()``.
        integrator: default ``IdaIntegrator()``, or ``MujocoIntegrator()``.
        external_torque: sines on the joints; default: none.
        transport_delay_s: time from a sample to the moment its torque acts.
        initial_angle_rad: start at these angles; default: on the reference, moving with it.
        initial_speed_rad_s: start there with these speeds; default: at rest.
        torque_limit_nm: largest torques the actuators deliver, whatever is commanded; default: no limit.

    Raises:
        InputError: robot and trajectory do not fit, or a value is out of range.
    """
    if robot.model.joints != trajectory.joints:
        raise InputError(trajectory.name, "joints", trajectory.joints, f"{robot.model.joints}, as {robot.id} has")
    arm = robot.with_payload_fraction(0.0 if plant == "nominal" else 1.0)
    usual = MujocoIntegrator() if plant == "mujoco" else IdaIntegrator()
    start = trajectory.evaluate(0.0)
    initial = {"angle_rad": start.angle.tolist(), "speed_rad_s": start.speed.tolist()}
    if initial_angle_rad is not None:
        speed = initial_speed_rad_s or (0.0,) * robot.model.joints
        initial = {"angle_rad": list(initial_angle_rad), "speed_rad_s": list(speed)}
    document = {
        "schema": "quasilpv.scenario",
        "schema_version": 1,
        "name": trajectory.name,
        "duration_s": trajectory.duration_s,
        "plant": arm.plant_document(plant),
        "integrator": (integrator or usual).model_dump(mode="json"),
        "external_torque": [term.model_dump(mode="json") for term in external_torque],
        "sensors": (sensors or Sensors()).model_dump(mode="json"),
        "transport_delay_s": transport_delay_s,
        "torque_limit_nm": None if torque_limit_nm is None else list(torque_limit_nm),
        "initial": initial,
    }
    return Scenario.from_document(document, trajectory.name)
