// What the actuated joints of a plant do at one instant.
#pragma once

#include <cstdint>
#include <optional>

#include "quasilpv/step.hpp"

namespace quasilpv {

/// The motors behind gears that give, per joint, reflected to it.
struct MotorSample {
  JointArray angle{};                     ///< rad
  JointArray speed{};                     ///< rad/s
  JointArray acceleration{};              ///< rad/s^2, of the torque in force
  JointArray joint_torque{};              ///< N m, what the gears transmit
  std::uint32_t sensors = kNoGearSensor;  ///< GearSensor bits: encoders on the motors, on the links, torque sensors
  JointArray torque_noise{};              ///< N m, standard deviation of what a torque sensor adds in every sample
  JointArray torque_quantum{};            ///< N m, a torque sensor says multiples of it; 0: it is exact
};

/// The truth at plant time t, which sensors blur and the controller never sees. Entries from the number of joints on
/// are 0.
struct PlantSample {
  JointArray angle{};                   ///< rad
  JointArray speed{};                   ///< rad/s
  JointArray acceleration{};            ///< rad/s^2, of the torque in force
  JointArray external_torque{};         ///< N m, at t
  std::optional<MotorSample> motors{};  ///< of elastic joints; nothing: a motor moves as its joint

  /// What torques push: the motors if there are some, else the joints.
  const JointArray& driven_speed() const noexcept { return motors ? motors->speed : speed; }
  const JointArray& driven_acceleration() const noexcept { return motors ? motors->acceleration : acceleration; }

  /// Whether encoders sit on motors, be there others on the links or not.
  bool carries_motor_encoders() const noexcept { return motors && (motors->sensors & kMotorAngle) != 0; }

  /// What encoders sit on: the motors if they carry them, else the joints.
  const JointArray& encoder_angle() const noexcept { return carries_motor_encoders() ? motors->angle : angle; }
  const JointArray& encoder_speed() const noexcept { return carries_motor_encoders() ? motors->speed : speed; }
};

}  // namespace quasilpv
