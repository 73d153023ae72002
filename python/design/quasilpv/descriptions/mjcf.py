"""MJCF, read by MuJoCo without its meshes: they are dropped before the model is compiled.

A body whose inertia MuJoCo would compute from a mesh has then none, and is refused where it moves. Joint damping of an
MJCF model often belongs to its position actuators, not to the robot: it is reported, never used unasked.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.descriptions.described_tree import BASE, DescribedJoint, DescribedTree
from quasilpv.descriptions.safe_xml import check_includes, read_xml, root_of
from quasilpv.errors import InputError
from quasilpv.systems.robots.spatial import Placement, SpatialInertia
from quasilpv.systems.robots.tree import JointKind


def read_mjcf(path: Path) -> DescribedTree:
    """What an MJCF file says.

    Raises:
        InputError: `mujoco` is not installed, the file cannot be read, includes files from elsewhere, or is no MJCF.
    """
    mujoco = _mujoco(path)
    root = root_of(path, read_xml(path))
    if root.tag != "mujoco":
        raise InputError(str(path), "root element", root.tag, "mujoco")
    check_includes(path, root)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        _without_meshes(mujoco, spec)
        model = spec.compile()
    except ValueError as error:
        raise InputError(str(path), "file", str(error), "an MJCF model with inertias that need no mesh") from error
    return _Reader(mujoco, model, str(path)).tree(spec.modelname)


def _mujoco(path: Path) -> Any:
    try:
        import mujoco  # noqa: PLC0415 -- heavy, and an extra
    except ImportError as error:
        expected = "MuJoCo, which reads MJCF: pip install 'quasilpv[robots]'"
        raise InputError(str(path), "library mujoco", "not installed", expected) from error
    return mujoco


def _without_meshes(mujoco: Any, spec: Any) -> None:
    """Drop what would need a file that is perhaps not on this machine."""
    for geom in list(spec.geoms):
        if geom.type in (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD) or geom.meshname:
            spec.delete(geom)
    for group in (spec.skins, spec.meshes, spec.hfields, spec.materials, spec.textures):
        for item in list(group):
            spec.delete(item)
    for geom in spec.geoms:
        geom.material = ""
    for site in spec.sites:
        site.material = ""


class _Reader:
    """From a compiled model to a described tree: one joint per degree of freedom, bodies without joints merged."""

    def __init__(self, mujoco: Any, model: Any, source: str) -> None:
        self._mujoco, self._model, self._source = mujoco, model, source
        self._kinds = {
            mujoco.mjtJoint.mjJNT_HINGE: (JointKind.REVOLUTE, "hinge"),
            mujoco.mjtJoint.mjJNT_SLIDE: (JointKind.PRISMATIC, "slide"),
            mujoco.mjtJoint.mjJNT_BALL: (None, "ball"),
            mujoco.mjtJoint.mjJNT_FREE: (None, "free"),
        }
        self._joints: list[DescribedJoint] = []
        self._body_at: list[tuple[int, Placement]] = []

    def tree(self, name: str) -> DescribedTree:
        """All bodies in order; a parent comes before its children."""
        model = self._model
        for body in range(model.nbody):
            self._add_body(body)
        frames = {self._name("body", b) or f"body {b}": where for b, where in enumerate(self._body_at)}
        for site in range(model.nsite):
            joint, place = self._body_at[model.site_bodyid[site]]
            own = Placement(_rotation(model.site_quat[site]), model.site_pos[site])
            frames[self._name("site", site) or f"site {site}"] = joint, place.then(own)
        return DescribedTree(self._source, name, tuple(self._joints), frames, np.array(model.opt.gravity))

    def _name(self, kind: str, index: int) -> str:
        return str(getattr(self._model, kind)(index).name)

    def _add_body(self, body: int) -> None:
        """Place a body, one joint after the other; the last joint carries its inertia."""
        model = self._model
        if body == 0:
            self._body_at.append((BASE, Placement.identity()))
            return
        carrier, place = self._body_at[model.body_parentid[body]]
        place = place.then(Placement(_rotation(model.body_quat[body]), model.body_pos[body]))
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        for joint in range(first, first + count):
            # The joint's frame stands at its anchor, with the axes of the body.
            anchor = Placement(np.eye(3), model.jnt_pos[joint])
            self._joints.append(self._joint(joint, body, carrier, place.then(anchor)))
            carrier, place = len(self._joints) - 1, Placement(np.eye(3), -model.jnt_pos[joint])
        self._body_at.append((carrier, place))
        if carrier != BASE:
            self._carry(carrier, self._inertia(body).seen_from(place))

    def _carry(self, carrier: int, inertia: SpatialInertia) -> None:
        joint = self._joints[carrier]
        self._joints[carrier] = replace(joint, inertia=joint.inertia.plus(inertia))

    def _inertia(self, body: int) -> SpatialInertia:
        model = self._model
        R = _rotation(model.body_iquat[body])
        rotational = R @ np.diag(model.body_inertia[body]) @ R.T
        return SpatialInertia.about_com(float(model.body_mass[body]), np.array(model.body_ipos[body]), rotational)

    def _joint(self, joint: int, body: int, parent: int, placement: Placement) -> DescribedJoint:
        model = self._model
        kind, word = self._kinds[self._mujoco.mjtJoint(model.jnt_type[joint])]
        limited = bool(model.jnt_limited[joint])
        if kind is JointKind.REVOLUTE and not limited:
            kind = JointKind.CONTINUOUS
        dof = int(model.jnt_dofadr[joint])
        return DescribedJoint(
            name=self._name("joint", joint) or f"joint {joint}",
            body=self._name("body", body),
            parent=parent,
            kind=kind,
            written_kind=word,
            placement=placement,
            axis=np.array(model.jnt_axis[joint]),
            inertia=SpatialInertia.zero(),
            lower=float(model.jnt_range[joint, 0]) if limited else -inf,
            upper=float(model.jnt_range[joint, 1]) if limited else inf,
            torque=self._largest_torque(joint),
            rotor_inertia_kg_m2=float(model.dof_armature[dof]) or None,
            damping_nm_s=float(model.dof_damping[dof, ...].max()) or None,
            friction_nm=float(model.dof_frictionloss[dof]) or None,
            follows=self._followed(joint),
        )

    def _largest_torque(self, joint: int) -> float | None:
        """The joint's own limit, or that of the one actuator on it."""
        model = self._model
        if model.jnt_actfrclimited[joint]:
            return float(np.abs(model.jnt_actfrcrange[joint]).min())
        torques = [
            float(np.abs(model.actuator_forcerange[a]).min() * abs(model.actuator_gear[a, 0]))
            for a in range(model.nu)
            if model.actuator_trntype[a] == self._mujoco.mjtTrn.mjTRN_JOINT
            and model.actuator_trnid[a, 0] == joint
            and model.actuator_forcelimited[a]
        ]
        return torques[0] if len(torques) == 1 else None

    def _followed(self, joint: int) -> str | None:
        """The joint an equality constraint ties it to."""
        model = self._model
        for e in range(model.neq):
            if model.eq_type[e] == self._mujoco.mjtEq.mjEQ_JOINT and model.eq_obj1id[e] == joint:
                other = int(model.eq_obj2id[e])
                return self._name("joint", other) if other >= 0 else "a constant"
        return None


def _rotation(quaternion: FloatArray) -> FloatArray:
    """Rotation matrix of a unit quaternion (w, x, y, z)."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
