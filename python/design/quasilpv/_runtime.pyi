"""The C++ runtime library. All arrays are of double; joint arrays have shape (joints,), SI units."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

_Array = npt.NDArray[np.float64]

def canonical_json(document: Any) -> bytes:
    """RFC 8785 bytes of a tree of dict, list, str, bool, None, int and float."""

def canonical_cbor(document: Any) -> bytes:
    """Deterministic CBOR bytes (RFC 8949 section 4.2) of the same trees."""

def parse_document(data: bytes, source: str = "document") -> Any:
    """Tree of a hashed document from the bytes of either twin; refused unless canonical and its hash agrees."""

LawMembers = dict[str, tuple[str, bool, "LawMembers"]]
"""Member -> (type, optional, members of it)."""

def law_schemas() -> dict[str, tuple[LawMembers, list[str]]]:
    """Kind of a law -> (members of ``law``, names of ``programs``), as its reader has it."""

class Artifact:
    """A validated controller as data. Immutable."""

    @staticmethod
    def load(path: str | bytes) -> Artifact: ...
    @staticmethod
    def parse(data: bytes, source: str = "artifact") -> Artifact: ...
    @property
    def name(self) -> str: ...
    @property
    def hash(self) -> str: ...
    @property
    def robot_id(self) -> str: ...
    @property
    def law_kind(self) -> str: ...
    @property
    def sample_period_s(self) -> float: ...
    @property
    def joints(self) -> int: ...
    def premises(self, angle: npt.ArrayLike) -> _Array:
        """z(y), not clamped, shape (premises,)."""

    def gravity(self, angle: npt.ArrayLike) -> _Array:
        """G(y), N m."""

    def coriolis(self, angle: npt.ArrayLike, speed: npt.ArrayLike, reference_speed: npt.ArrayLike) -> _Array:
        """N(y, w) r' of a PID law, N(y, w) w of a computed-torque law, N m."""

    def inertia(self, premise: npt.ArrayLike) -> _Array:
        """M_n(z), kg m^2, shape (joints, joints); z is clamped to its box."""

class StepReport:
    """What one step computed; joint arrays have shape (7,), zero past the joints."""

    @property
    def seq(self) -> int: ...
    @property
    def flags(self) -> int: ...
    @property
    def torque_commanded(self) -> _Array: ...
    @property
    def torque_applied(self) -> _Array: ...
    @property
    def estimated_angle(self) -> _Array: ...
    @property
    def estimated_speed(self) -> _Array: ...
    @property
    def estimated_disturbance(self) -> _Array: ...
    @property
    def filtered_disturbance(self) -> _Array: ...
    @property
    def integral_error(self) -> _Array: ...

class Controller:
    """Law, state and workspace of one artifact."""

    def __init__(self, artifact: Artifact) -> None: ...
    def step(
        self,
        angle: npt.ArrayLike,
        reference_angle: npt.ArrayLike,
        reference_speed: npt.ArrayLike,
        reference_acceleration: npt.ArrayLike,
        speed: npt.ArrayLike,
        seq: int = 0,
        valid: bool = True,
        gears: Mapping[str, npt.ArrayLike] = ...,
    ) -> StepReport:
        """One sample; arrays of shape (joints,).

        Args:
            gears: what is measured of joints that give, by name: motor_angle_rad, link_angle_rad, joint_torque_nm. A
                law that controls one side gets the angles of that side.
        """

    def reset(self) -> None:
        """Forget all state."""

    @property
    def joints(self) -> int: ...
    @property
    def sample_period_s(self) -> float: ...

class Trajectory:
    """Reference r(t), r'(t), r''(t): piecewise quintics in joint space."""

    @staticmethod
    def load(path: str | bytes) -> Trajectory: ...
    @staticmethod
    def parse(data: bytes, source: str = "trajectory") -> Trajectory: ...
    def evaluate(self, time_s: float) -> tuple[_Array, _Array, _Array]:
        """(r, r', r'') at a time, each of shape (joints,)."""

    @property
    def name(self) -> str: ...
    @property
    def hash(self) -> str: ...
    @property
    def joints(self) -> int: ...
    @property
    def duration_s(self) -> float: ...

class Scenario:
    """The experiment: true plant, integrator, disturbance, sensors, delay."""

    @staticmethod
    def load(path: str | bytes) -> Scenario: ...
    @staticmethod
    def parse(data: bytes, source: str = "scenario") -> Scenario: ...
    @property
    def name(self) -> str: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def joints(self) -> int: ...

class Plant:
    """The true plant of a scenario, its external torque attached."""

    def __init__(self, scenario: Scenario) -> None: ...
    @property
    def joints(self) -> int: ...
    @property
    def size(self) -> int: ...
    def residual(self, time_s: float, state: npt.ArrayLike, derivative: npt.ArrayLike, torque: npt.ArrayLike) -> _Array:
        """F(t, y, y') under a control torque (N m), shape (size,)."""

    def derivative(self, time_s: float, state: npt.ArrayLike, torque: npt.ArrayLike) -> _Array:
        """Forward dynamics: y' of the differential components, 0 for multipliers, shape (size,)."""

    def initial_state(self, angle: npt.ArrayLike, speed: npt.ArrayLike) -> _Array:
        """y with the joints at these angles and speeds, shape (size,)."""

    def make_consistent(self, time_s: float, state: npt.ArrayLike, torque: npt.ArrayLike) -> tuple[_Array, _Array]:
        """(y, y') near a state that satisfy the equations and all constraints, multipliers included."""

    def mass_matrix(self, angle: npt.ArrayLike) -> _Array:
        """M(theta), kg m^2, shape (joints, joints)."""

class ControlLoop:
    """One controller with its start, its policy and its limits."""

    def __init__(self, artifact: Artifact, trajectory: Trajectory, bumpless_start: bool = False) -> None: ...
    def handle(
        self,
        seq: int,
        angle: npt.ArrayLike,
        speed: npt.ArrayLike,
        foreign_messages: int = 0,
        gears: Mapping[str, npt.ArrayLike] = ...,
    ) -> None:
        """Answer the reading of a sample newer than the last; the clock is seq T."""

    def reset_fault(self) -> bool:
        """Leave a latched fault; whether that was possible."""

    @property
    def torque(self) -> _Array:
        """N m, of the last command, shape (joints,)."""

    @property
    def state(self) -> str: ...
    @property
    def cause(self) -> str: ...
    @property
    def flags(self) -> int:
        """Fault bits of the last command."""

    @property
    def predicted_steps(self) -> int: ...
    @property
    def faults(self) -> int: ...
    @property
    def refusal(self) -> str | None:
        """Why there was no start, in one line; None if there was one."""

class PlantSession:
    """The plant of a scenario, sample by sample, behind its sensors."""

    def __init__(self, scenario: Scenario, sample_period_s: float) -> None: ...
    @property
    def seq(self) -> int: ...
    @property
    def samples(self) -> int: ...
    def measure(self) -> tuple[_Array, _Array]:
        """Measured (angle, speed) of the sample, each of shape (joints,)."""

    @property
    def gears(self) -> dict[str, _Array]:
        """What the sensors of the gears measured, by name; empty for a robot without them."""

    @property
    def angle(self) -> _Array: ...
    @property
    def speed(self) -> _Array: ...
    def advance(self, torque: npt.ArrayLike) -> None:
        """Integrate over the sample under a torque (N m)."""

class Tree:
    """The motion of a robot in space, as the run-time side computes it."""

    def __init__(self, document: Any) -> None:
        """From a document of kind `tree`."""

    @property
    def joints(self) -> int: ...
    def torque_at_rest(self, coordinate: npt.ArrayLike, acceleration: npt.ArrayLike) -> _Array:
        """M(q) a + G(q), N m, shape (joints,)."""

    def inverse_dynamics(self, coordinate: npt.ArrayLike, speed: npt.ArrayLike, acceleration: npt.ArrayLike) -> _Array:
        """M(q) a + h(q, w), N m, shape (joints,)."""

    def inertia(self, coordinate: npt.ArrayLike) -> _Array:
        """M(q), kg m^2, shape (joints, joints)."""

    def derivatives(
        self, coordinate: npt.ArrayLike, speed: npt.ArrayLike, acceleration: npt.ArrayLike
    ) -> tuple[_Array, _Array]:
        """Of inverse_dynamics with respect to coordinates and speeds, two arrays of shape (joints, joints)."""

    def energy(self, coordinate: npt.ArrayLike, speed: npt.ArrayLike) -> float:
        """Kinetic plus potential, J."""

def run_closed_loop(
    artifact: Artifact,
    trajectory: Trajectory,
    scenario: Scenario,
    advance: Callable[[float, float, _Array, _Array], _Array] | None = None,
) -> dict[str, _Array]:
    """The closed loop in lock-step: columns by name, shape (samples,) or (samples, joints).

    `advance(from_s, to_s, state, torque)` integrates the plant instead of the scenario's integrator.
    """

class SystemArtifact:
    """The controller of a general system, validated."""

    @staticmethod
    def load(path: str) -> SystemArtifact: ...
    @staticmethod
    def parse(data: bytes, source: str = ...) -> SystemArtifact: ...
    @property
    def name(self) -> str: ...
    @property
    def hash(self) -> str: ...

class SystemController:
    """``u = K(z) x_d``, limited, one call per sample."""

    def __init__(self, artifact: SystemArtifact) -> None: ...
    def reset(self) -> None: ...
    def step(self, state: npt.ArrayLike, parameter: npt.ArrayLike) -> dict[str, Any]: ...

class SystemScenario:
    estimate: list[float]
    @property
    def name(self) -> str: ...
    @property
    def samples(self) -> int: ...
    @staticmethod
    def parse(data: bytes, source: str, artifact: SystemArtifact) -> SystemScenario: ...

def disturbance_of(artifact: SystemArtifact, scenario: SystemScenario) -> npt.NDArray[np.float64]: ...
def simulate_system(artifact: SystemArtifact, scenario: SystemScenario) -> dict[str, Any]: ...
