"""Which controller is asked for, of which robot, with what specification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from quasilpv.synthesis.registry import DEFAULT_CONTROLLER, controller_kind
from quasilpv.synthesis.specification import Specification

if TYPE_CHECKING:
    from quasilpv.systems.robots.registry import AnyRobot


ACTIVITY_IN_SPACE = 0.02
"""Default torque activity of robots in space, a share of each joint's limit."""


@dataclass(frozen=True)
class DesignRequest:
    """A design, before it is made.

    Attributes:
        robot: what is designed for.
        controller: one of `CONTROLLERS`.
        specification: what is asked for; baselines use its sample rate only.
        compensated: False to leave the observed disturbance out of the torque, see `without_compensation`.
    """

    robot: AnyRobot
    controller: str
    specification: Specification
    compensated: bool = True

    @classmethod
    def of(
        cls,
        robot: AnyRobot | str,
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
        from quasilpv.systems.robots.registry import any_robot  # noqa: PLC0415 -- help pages ask for no robot

        source = any_robot(robot) if isinstance(robot, str) else robot
        return cls(source, controller, specification or specification_for(source, controller), compensated)


def specification_for(
    robot: AnyRobot,
    controller: str = DEFAULT_CONTROLLER,
    *,
    rate_hz: float | None = None,
    encoder_bits: int | None = None,
    margin_spare: float | None = None,
    torque_activity: float | None = None,
) -> Specification:
    """The specification for these numbers; what is not given, and exact angles (0 bits), keep their default.

    The default rate is the controller's own, the frequency of disturbances the robot's; the delay to tolerate is at
    least the robot's own. For a robot in space the default torque activity is `ACTIVITY_IN_SPACE`.

    Args:
        robot: what is designed for.
        controller: one of `CONTROLLERS`.
        rate_hz, encoder_bits, margin_spare, torque_activity: see `Specification`.

    Raises:
        InputError: an unknown controller, or a number out of range.
    """
    rate = controller_kind(controller).rate_hz if rate_hz is None else rate_hz
    activity = ACTIVITY_IN_SPACE if robot.in_space else Specification.torque_activity
    return Specification(
        rate_hz=rate,
        delay_samples=max(Specification.delay_samples, robot.delay_s[1] * rate),
        encoder_bits=encoder_bits or Specification.encoder_bits,
        margin_spare=Specification.margin_spare if margin_spare is None else margin_spare,
        torque_activity=activity if torque_activity is None else torque_activity,
        disturbance_frequency_rad_s=robot.disturbance_frequency_rad_s,
    )
