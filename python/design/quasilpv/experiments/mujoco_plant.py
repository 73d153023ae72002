"""Robots in space moved by MuJoCo: a third plant, which shares no equation with the other two.

The robot is written from the document of a plant, body by body. MuJoCo integrates it with its Runge-Kutta method of
order 4 and equal steps while the torque is held; viscous friction is its own damping, smoothed Coulomb friction and
external torques are evaluated at every stage. Todorov, Erez and Tassa (2012).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.documents.plants import RubbingJoint, TreePlant
from quasilpv.errors import InputError, PlantError
from quasilpv.scenarios import MujocoIntegrator, Scenario, SineTorque
from quasilpv.systems.robots.spatial import SpatialInertia

SHORTEST_STEP_S = 1e-9
"""What remains of an interval below this is no step."""

LARGEST = 1e10
"""No angle, m or rad, and no speed is larger: MuJoCo's own bound (mjMAXVAL)."""


class MujocoPlant:
    """The plant of a scenario.

    Args:
        scenario: of a robot in space, with an integrator of kind ``mujoco``.
        sample_period_s: of the controller, of which a step is a part.

    Raises:
        InputError: MuJoCo is not installed, or has no such body: one without mass, or with principal moments that break
            the triangle inequality.
    """

    def __init__(self, scenario: Scenario, sample_period_s: float) -> None:
        """Write the robot, and have it compiled."""
        plant, integrator = scenario.plant, scenario.integrator
        assert isinstance(plant, TreePlant)
        assert isinstance(integrator, MujocoIntegrator)
        self._mujoco = require_mujoco(scenario.name)
        self._step_s = sample_period_s / integrator.steps_per_sample
        self._model = _compiled(self._mujoco, plant, scenario.name)
        self._data = self._mujoco.MjData(self._model)
        self._coulomb_nm = np.array([joint.friction_coulomb_nm for joint in plant.chain])
        self._coulomb_speed_rad_s = np.array([joint.coulomb_speed_rad_s for joint in plant.chain])
        self._external = scenario.external_torque

    def advance(self, from_s: float, to_s: float, state: FloatArray, torque: FloatArray) -> FloatArray:
        """The state (q, w), (2 n,), at ``to_s``, a torque held since ``from_s``: see `_runtime.run_closed_loop`.

        Raises:
            PlantError: the motion grew beyond numbers: the step is too long, or the loop unstable.
        """
        data, n = self._data, torque.size
        data.qpos[:], data.qvel[:] = state[:n], state[n:]
        data.qfrc_applied[:] = torque
        data.qacc_warmstart[:] = 0.0
        data.time = from_s
        steps = max(math.ceil((to_s - from_s - SHORTEST_STEP_S) / self._step_s), 1)
        self._model.opt.timestep = (to_s - from_s) / steps
        self._mujoco.mj_step(self._model, data, steps)
        found = np.concatenate([data.qpos, data.qvel])
        if not (np.abs(found) < LARGEST).all():  # not finite, too
            raise PlantError(f"MuJoCo: the state is not finite at t = {to_s:g} s, with steps of {self._step_s:g} s")
        return found

    @contextmanager
    def running(self) -> Iterator[None]:
        """While inside, MuJoCo of this process asks this plant for friction and external torques.

        Its warnings, of states that are not finite, are errors of `advance`; alone it would write them in a file.
        """
        warned = self._mujoco.get_mju_user_warning()
        self._mujoco.set_mju_user_warning(lambda _: None)
        self._mujoco.set_mjcb_passive(self._passive)
        try:
            yield
        finally:
            self._mujoco.set_mjcb_passive(None)
            self._mujoco.set_mju_user_warning(warned)

    def _passive(self, _: Any, data: Any) -> None:
        rubbing = self._coulomb_nm * np.tanh(data.qvel / self._coulomb_speed_rad_s)
        data.qfrc_passive[:] += external_torque(self._external, data.time, rubbing.size) - rubbing


def external_torque(terms: Sequence[SineTorque], time_s: float, joints: int) -> FloatArray:
    """Sum of the sines on every joint, (n,), N m."""
    torque = np.zeros(joints)
    for term in terms:
        torque[term.joint] += term.amplitude_nm * math.sin(term.frequency_rad_s * time_s + term.phase_rad)
    return torque


def require_mujoco(source: str) -> Any:
    """The library.

    Raises:
        InputError: it is not installed.
    """
    try:
        import mujoco  # noqa: PLC0415 -- heavy, and an extra
    except ImportError as error:
        expected = "MuJoCo, which moves this plant: pip install 'quasilpv[robots]'"
        raise InputError(source, "library mujoco", "not installed", expected) from error
    return mujoco


def _compiled(mujoco: Any, plant: TreePlant, source: str) -> Any:
    """The robot as MuJoCo's model, without geometry and contacts."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = plant.gravity_m_s2
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    # A state that is not finite is an error here; MuJoCo alone would begin anew at zero, and say so in a file.
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_AUTORESET
    body = spec.worldbody
    for joint in plant.chain:
        body = _add(mujoco, body, joint)
    try:
        return spec.compile()
    except ValueError as error:
        raise InputError(source, "plant", " ".join(str(error).split()), "a robot that MuJoCo takes") from error


def _add(mujoco: Any, parent: Any, joint: RubbingJoint) -> Any:
    """One body with its joint."""
    inertia = SpatialInertia(joint.mass_kg, np.array(joint.first_moment_kg_m), np.array(joint.rotational_kg_m2))
    about_com, quaternion = inertia.about_its_com_kg_m2, np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.array(joint.rotation).ravel())
    body = parent.add_body(name=joint.name, pos=joint.translation_m, quat=quaternion)
    body.explicitinertial = True
    body.mass, body.ipos = joint.mass_kg, inertia.com_m
    body.fullinertia = [*np.diag(about_com), about_com[0, 1], about_com[0, 2], about_com[1, 2]]
    body.add_joint(
        name=joint.name,
        type=mujoco.mjtJoint.mjJNT_SLIDE if joint.kind == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE,
        axis=joint.axis,
        armature=joint.rotor_inertia_kg_m2,
        damping=joint.friction_viscous_nm_s,
    )
    return body
