"""Meshes that a URDF names, for those who look at the robot: no law and no proof reads them.

Files of strangers, as the description itself: only those it names are opened, only below its own folder and those that
are stated, and none that such a file names in turn.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.descriptions.robot_file import RobotSource
from quasilpv.descriptions.safe_xml import read_xml, root_of
from quasilpv.errors import InputError
from quasilpv.files import read_bytes
from quasilpv.systems.robots.spatial import Placement

SUFFIXES = (".stl", ".obj")
"""Formats that name no other files, or not where it matters; of a body in another format its collision meshes count."""
MOST_TRIANGLES = 500_000
_PACKAGE = "package://"


@dataclass(frozen=True, eq=False)
class BodyMesh:
    """What is drawn of one body.

    Attributes:
        link: its name.
        joint: index of the joint of the chain it moves with; -1 for the base.
        vertices_m: (N, 3), in the frame of that joint.
        faces: (M, 3), indices of vertices.
    """

    link: str
    joint: int
    vertices_m: FloatArray
    faces: np.ndarray[Any, np.dtype[np.int64]]


def body_meshes(source: RobotSource, folders: Sequence[Path] = ()) -> tuple[list[BodyMesh], list[str]]:
    """The meshes of a robot whose files are there, and the names of those that are not or cannot be read here.

    Args:
        source: a robot file with its URDF.
        folders: where packages and files beside the folder of the description are looked for.

    Raises:
        InputError: the description is no URDF, a name leads out of the folders, or a file is damaged or too large.
        ImportError: `trimesh` is not installed: it comes with the extra ``view``.
    """
    path = Path(source.described.source)
    root = root_of(path, read_xml(path))
    if root.tag != "robot":
        raise InputError(str(path), "root element", root.tag, "robot: meshes are shown of a URDF")
    places, found = source.places(), []
    missing: list[str] = []
    for link in root.findall("link"):
        name = link.get("name", "")
        joint, place = places[name]
        for file, own, scale in _of_link(path, link, folders, missing):
            vertices, faces = _read(file)
            where = place.then(own)
            shown = (vertices * scale) @ where.rotation.T + where.translation_m
            found.append(BodyMesh(name, joint, shown, faces))
    return found, missing


def _of_link(
    path: Path, link: ElementTree.Element, folders: Sequence[Path], missing: list[str]
) -> Iterator[tuple[Path, Placement, FloatArray]]:
    """Files, placements in the link's frame and scales of the visual meshes, or else of those for collisions."""
    for kind in ("visual", "collision"):
        shown = []
        for element in link.findall(kind):
            mesh = element.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            file = located(path, name, folders)
            if file is None or file.suffix.lower() not in SUFFIXES:
                missing.append(name)
                continue
            scale = _numbers(path, mesh.get("scale"), "scale", (1.0, 1.0, 1.0))
            shown.append((file, _origin(path, element.find("origin")), scale))
        if shown:
            yield from shown
            return


def located(path: Path, name: str, folders: Sequence[Path]) -> Path | None:
    """The file that a description calls so; None if there is none.

    Args:
        path: of the description.
        name: as it stands there: a path, or ``package://PACKAGE/PATH``.
        folders: below which it may be, besides the description's own.

    Raises:
        InputError: it is outside of all of them.
    """
    allowed = [path.parent.resolve(), *(folder.resolve() for folder in folders)]
    inside = name.removeprefix(_PACKAGE).removeprefix("file://")
    short = inside.partition("/")[2] if name.startswith(_PACKAGE) else inside
    outside = True
    for folder in allowed:
        for candidate in (folder / inside, folder / short):
            target = candidate.resolve()
            if not any(target.is_relative_to(one) for one in allowed):
                continue
            outside = False
            if target.is_file():
                return target
    if outside:
        raise InputError(str(path), "mesh", name, f"a file below {' or '.join(map(str, allowed))} (--meshes)")
    return None


def _read(path: Path) -> tuple[FloatArray, np.ndarray[Any, np.dtype[np.int64]]]:
    import trimesh  # noqa: PLC0415 -- heavy, and an extra

    content = io.BytesIO(read_bytes(path))
    try:
        mesh = trimesh.load_mesh(content, file_type=path.suffix[1:].lower(), resolver=None, skip_materials=True)
        if isinstance(mesh, trimesh.Scene):
            mesh = mesh.to_mesh()
        vertices, faces = np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)
    except Exception as error:  # whatever the library throws at a file it cannot take
        raise InputError(str(path), "mesh", str(error) or type(error).__name__, "an STL or OBJ file") from error
    if not 0 < len(faces) <= MOST_TRIANGLES or not np.all(np.isfinite(vertices)):
        raise InputError(str(path), "mesh", f"{len(faces)} triangles", f"1 to {MOST_TRIANGLES}, all finite")
    return vertices, faces


def _origin(path: Path, origin: ElementTree.Element | None) -> Placement:
    if origin is None:
        return Placement.identity()
    roll, pitch, yaw = _numbers(path, origin.get("rpy"), "rpy", (0.0, 0.0, 0.0))
    turned = Placement.turned((0.0, 0.0, 1.0), yaw).then(Placement.turned((0.0, 1.0, 0.0), pitch))
    rotation = turned.then(Placement.turned((1.0, 0.0, 0.0), roll)).rotation
    return Placement(rotation, _numbers(path, origin.get("xyz"), "xyz", (0.0, 0.0, 0.0)))


def _numbers(path: Path, text: str | None, field: str, default: tuple[float, float, float]) -> FloatArray:
    try:
        values = np.array(default if text is None else [float(word) for word in text.split()])
    except ValueError:
        values = np.full(1, np.nan)
    if values.shape != (3,) or not np.all(np.isfinite(values)):
        raise InputError(str(path), f"mesh, {field}", text, "three finite numbers")
    return values
