// The hardware seam: joint positions in, joint torques out. One implementation per robot.
#pragma once

#include <cstdint>

#include "quasilpv/control_port.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// What a robot measured at one sample.
struct RobotReading {
  std::int64_t seq = 0;       ///< sample index k since the robot started, so its time is k T; a gap is a lost sample
  std::int64_t taken_ns = 0;  ///< monotonic_ns() of the measurement
  JointArray angle_rad{};     ///< NaN marks an encoder that failed: the observer then predicts
  JointArray speed_rad_s{};   ///< read only by laws that need a measured speed; 0 otherwise
  GearReading gears{};        ///< motor_angle_rad, link_angle_rad, joint_torque_nm, as far as there are sensors
};

/// What a robot shall do from now on.
struct RobotCommand {
  std::int64_t seq = 0;  ///< of the reading it answers
  JointArray torque_nm{};
  ControllerState state = ControllerState::kInit;
  std::uint32_t flags = kStepHealthy;  ///< StepFlag bits
};

/// A robot as the control thread sees it: ControlPort says what a driver author implements. Torques are finite and
/// within the artifact's torque and slew limits; without them the drive must brake.
using Robot = ControlPort<RobotReading, RobotCommand>;

}  // namespace quasilpv
