"""Print how well the inertia of robots is bounded: tools/robots-table [--robot NAME]...

Every robot of the pip package example-robot-data that is named below, over the full range of its joints and over a box
around a working posture, with its rated payload, and with 20 % more and less on every link and rotor besides.
M is the inertia with half the payload. The files are read as a user's are, each through a robot.toml.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from quasilpv.descriptions.inertia_range import RangeSide, range_sides
from quasilpv.descriptions.robot_file import read_description, read_robot_file
from quasilpv.errors import InputError
from quasilpv.systems.robots.spatial_robot import SpatialRobot

PACKAGE = "example-robot-data"
FOLDER = "cmeel.prefix/share/example-robot-data/robots"
ROTOR_INERTIA_KG_M2 = 0.1
"""Of every joint: none of these files says anything."""

TOLERANCE = 0.2
BOX_RAD = 0.7
"""Half a side of the box around the working posture, cut at the limits of the joints."""

LARGEST_GAP = {"full": 0.02, "box": 0.04}
"""Between proved and sampled bounds, relative."""

CONTROL = 0.005
"""By which a bound beyond the sampled one, which is false, is refused."""


@dataclass(frozen=True)
class Entry:
    """A robot of the table.

    Attributes:
        file: below the folder of the package.
        tip: the frame that carries the load.
        mass_kg: of the rated payload.
        posture_rad: in the middle of the box.
        locked: joints that are held.
    """

    file: str
    tip: str
    mass_kg: float
    posture_rad: tuple[float, ...]
    locked: tuple[tuple[str, float], ...] = ()


ROBOTS = {
    "UR5": Entry("ur_description/urdf/ur5_robot.urdf", "tool0", 5.0, (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)),
    "UR10": Entry("ur_description/urdf/ur10_robot.urdf", "tool0", 10.0, (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)),
    "Panda": Entry(
        "panda_description/urdf/panda.urdf",
        "panda_hand_tcp",
        3.0,
        (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785),
        (("panda_finger_joint1", 0.0), ("panda_finger_joint2", 0.0)),
    ),
    "xArm7": Entry("xarm_description/urdf/xarm7.urdf", "link_eef", 3.5, (0.0, -0.3, 0.0, 1.2, 0.0, 1.0, 0.0)),
    "TIAGo arm": Entry(
        "tiago_description/robots/tiago_no_hand.urdf",
        "arm_tool_link",
        2.0,
        (1.4, -0.3, -1.0, 1.5, 0.0, 0.0, 0.0),
        (("torso_lift_joint", 0.15),),
    ),
}


@dataclass(frozen=True, eq=False)
class Row:
    """One line of the table.

    Attributes:
        name, domain, tolerance: what was asked.
        sides: lowest and highest.
        proved: whether each bound holds.
        refused: whether each bound that samples refute is refused.
        seconds_to_check: of both bounds.
    """

    name: str
    domain: str
    tolerance: float
    sides: tuple[RangeSide, RangeSide]
    proved: tuple[bool, ...]
    refused: tuple[bool, ...]
    seconds_to_check: float

    @property
    def gaps(self) -> tuple[float, ...]:
        """By which the proved bounds lie beyond the sampled ones, relative; infinite without a bound."""
        return tuple(
            float("inf") if side.bound is None else abs(side.bound / side.sampled - 1.0) for side in self.sides
        )

    @property
    def holds(self) -> bool:
        """Both bounds proved, near the sampled ones, and beyond them refused."""
        return all((*self.proved, *self.refused)) and max(self.gaps) <= LARGEST_GAP[self.domain]

    def cells(self) -> list[str]:
        """As text."""
        low, high = self.sides
        return [
            self.name,
            self.domain,
            f"±{100 * self.tolerance:.0f} %",
            f"{low.sampled:.4f} - {high.sampled:.4f}",
            " - ".join("none" if s.bound is None else f"{s.bound:.4f}" for s in self.sides),
            ", ".join(f"{100 * gap:.2f} %" for gap in self.gaps),
            f"{sum(side.seconds_to_find for side in self.sides):.1f}",
            f"{self.seconds_to_check:.2f}",
            "yes" if all(self.refused) else "NO",
            "proved" if all(self.proved) else "NOT PROVED",
        ]


COLUMNS = (
    "robot",
    "domain",
    "links, rotors",
    "sampled",
    "proved",
    "gaps",
    "find, s",
    "check, s",
    "false bounds refused",
    "verdict",
)


def package_folder() -> Path:
    """Where the descriptions are.

    Raises:
        InputError: the package is not installed.
    """
    try:
        return Path(str(distribution(PACKAGE).locate_file(FOLDER)))
    except PackageNotFoundError as error:
        raise InputError("table of robots", f"package {PACKAGE}", "not installed", f"pip install {PACKAGE}") from error


def robot_of(entry: Entry, folder: Path, *, domain: str = "full", tolerance: float = 0.0) -> SpatialRobot:
    """A robot of the table, read through a robot.toml as a user writes it.

    Args:
        entry: of the table.
        folder: of the package.
        domain: ``"full"`` or ``"box"``.
        tolerance: share by which every link and rotor may differ.
    """
    with tempfile.TemporaryDirectory() as own:
        path = Path(own) / "robot.toml"
        path.write_text("\n".join(_lines(entry, folder / entry.file, domain, tolerance)))
        return read_robot_file(path).robot()


def _lines(entry: Entry, description: Path, domain: str, tolerance: float) -> Iterator[str]:
    described = read_description(description)
    joints = described.moving(described.tip(entry.tip), dict(entry.locked))
    yield f'description = "{description}"\ntip_link = "{entry.tip}"\n[uncertainty]\nlinks = {tolerance}'
    yield f"[payload]\nmass = {entry.mass_kg}\ncom_box = [[-0.03, 0.03], [-0.03, 0.03], [0.02, 0.08]]"
    yield f"inertia = {0.002 * entry.mass_kg}"
    yield "[locked]"
    yield from (f"{name} = {value}" for name, value in entry.locked)
    for joint, middle in zip(joints, entry.posture_rad, strict=True):
        yield f"[joints.{joint.name}]\nrotor_inertia = {ROTOR_INERTIA_KG_M2}\nrotor_tolerance = {tolerance}"
        yield "rigid = true"
        if domain == "box":
            yield f"angle = [{max(middle - BOX_RAD, joint.lower)}, {min(middle + BOX_RAD, joint.upper)}]"


def measured(name: str, folder: Path, domain: str, tolerance: float) -> Row:
    """One line of the table."""
    sides = range_sides(robot_of(ROBOTS[name], folder, domain=domain, tolerance=tolerance))
    began = time.perf_counter()
    proved = tuple(side.bound is not None and side.prove(side.bound).holds for side in sides)
    check = time.perf_counter() - began
    factors = {"lowest": 1.0 + CONTROL, "highest": 1.0 - CONTROL}
    refused = tuple(side.bound is None or not side.prove(factors[side.side] * side.sampled).holds for side in sides)
    return Row(name, domain, tolerance, sides, proved, refused, check)


def table(names: Sequence[str]) -> Iterator[Row]:
    """The lines of some robots."""
    folder = package_folder()
    for name in names:
        for domain in LARGEST_GAP:
            for tolerance in (0.0, TOLERANCE):
                yield measured(name, folder, domain, tolerance)


def main() -> int:
    """Print the table; 1 if a line does not hold what is asked of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", action="append", choices=[*ROBOTS], help="may be repeated; default: all")
    names = parser.parse_args().robot or [*ROBOTS]
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    good = True
    for row in table(names):
        print("| " + " | ".join(row.cells()) + " |", flush=True)
        good &= row.holds
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
