// What the actuated joints of a plant do at one instant.
#pragma once

#include <optional>

#include "quasilpv/step.hpp"

namespace quasilpv {

/// The motors behind gears that give, per joint, reflected to it.
struct MotorSample {
  JointArray angle{};             ///< rad
  JointArray speed{};             ///< rad/s
  JointArray acceleration{};      ///< rad/s^2, of the torque in force
  bool carries_encoders = false;  ///< false: the encoders sit on the links
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

  /// What encoders sit on: the motors if they carry them, else the joints.
  const JointArray& encoder_angle() const noexcept {
    return motors && motors->carries_encoders ? motors->angle : angle;
  }
  const JointArray& encoder_speed() const noexcept {
    return motors && motors->carries_encoders ? motors->speed : speed;
  }
};

}  // namespace quasilpv
