"""Which controller is asked for, of which robot, with what specification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from quasilpv.synthesis.registry import DEFAULT_CONTROLLER, controller_kind
from quasilpv.synthesis.specification import Specification

if TYPE_CHECKING:
    from quasilpv.systems.robots.registry import Robot


@dataclass(frozen=True)
class DesignRequest:
    """A design, before it is made.

    Attributes:
        robot: what is designed for.
        controller: one of `CONTROLLERS`.
        specification: what is asked for; baselines use its sample rate only.
        compensated: False to leave the observed disturbance out of the torque, see `without_compensation`.
    """

    robot: Robot
    controller: str
    specification: Specification
    compensated: bool = True

    @classmethod
    def of(
        cls,
        robot: Robot | str,
        controller: str = DEFAULT_CONTROLLER,
        specification: Specification | None = None,
        *,
        compensated: bool = True,
    ) -> DesignRequest:
        """A request with what is not given filled in.

        Args:
            robot: a robot, or its name in the registry.
            controller: one of `CONTROLLERS`.
            specification: by default that of `specification_for`: at the controller's own rate and the robot's own
                frequency of disturbances.
            compensated: see the class.

        Raises:
            InputError: unknown robot or controller.
        """
        from quasilpv.systems.robots.registry import robot as known  # noqa: PLC0415 -- help pages ask for no robot

        source = known(robot) if isinstance(robot, str) else robot
        return cls(source, controller, specification or specification_for(source, controller), compensated)


def specification_for(
    robot: Robot,
    controller: str = DEFAULT_CONTROLLER,
    *,
    rate_hz: float | None = None,
    encoder_bits: int | None = None,
    margin_spare: float | None = None,
    torque_activity: float | None = None,
) -> Specification:
    """The specification for these numbers; what is not given, and exact angles (0 bits), keep their default.

    The default rate is the controller's own, the frequency of disturbances the robot's.

    Args:
        robot: what is designed for.
        controller: one of `CONTROLLERS`.
        rate_hz, encoder_bits, margin_spare, torque_activity: see `Specification`.

    Raises:
        InputError: an unknown controller, or a number out of range.
    """
    return Specification(
        rate_hz=controller_kind(controller).rate_hz if rate_hz is None else rate_hz,
        encoder_bits=encoder_bits or Specification.encoder_bits,
        margin_spare=Specification.margin_spare if margin_spare is None else margin_spare,
        torque_activity=Specification.torque_activity if torque_activity is None else torque_activity,
        disturbance_frequency_rad_s=robot.disturbance_frequency_rad_s,
    )
