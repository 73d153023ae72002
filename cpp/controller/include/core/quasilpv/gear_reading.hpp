// What is measured on both sides of gears that give. Plain data, no allocation, trivially copyable.
#pragma once

#include <array>
#include <cstdint>

namespace quasilpv {

inline constexpr int kMaxJoints = 7;

/// One value per joint; entries from the number of joints on are zero.
using JointArray = std::array<double, kMaxJoints>;

/// Sensors of a robot's gears, as bits.
enum GearSensor : std::uint32_t {
  kNoGearSensor = 0,
  kMotorAngle = 1u << 0,
  kLinkAngle = 1u << 1,
  kJointTorque = 1u << 2,
  kAllGearSensors = kMotorAngle | kLinkAngle | kJointTorque
};

/// Which angles a law controls.
enum class AngleSide : std::uint8_t {
  kJoint,  ///< those of the encoders, wherever they sit: for joints that are rigid
  kMotor,  ///< of the motors, reflected to the joints
  kLink
};

/// What the sensors of the gears said at one sample. Without its bit in `available` a quantity means nothing.
struct GearReading {
  std::uint32_t available = kNoGearSensor;  ///< GearSensor bits: what all joints have
  JointArray motor_angle_rad{};             ///< reflected to the joints: the motor's angle over the gear's ratio
  JointArray link_angle_rad{};
  JointArray joint_torque_nm{};  ///< from the motor to the link, what the gear transmits; positive moves the joint on

  bool has(GearSensor sensor) const noexcept { return (available & sensor) != 0; }
};

/// The angles that a law controls: those of its side. A robot that says nothing of sides has one encoder per joint,
/// `angle`, whatever it sits on. Null: the robot has encoders on the other side only. RT-SAFE (bounded, no allocation,
/// no lock, no throw).
inline const JointArray* controlled_angle(AngleSide side, const JointArray& angle, const GearReading& gears) noexcept {
  if (side == AngleSide::kJoint || (gears.available & (kMotorAngle | kLinkAngle)) == 0) {
    return &angle;
  }
  if (side == AngleSide::kMotor) {
    return gears.has(kMotorAngle) ? &gears.motor_angle_rad : nullptr;
  }
  return gears.has(kLinkAngle) ? &gears.link_angle_rad : nullptr;
}

/// The reading without the sensors of which one joint's value is not finite: a law sees all joints of a sensor, or
/// none. RT-SAFE (bounded, no allocation, no lock, no throw).
GearReading without_failed_sensors(const GearReading& gears, int joints) noexcept;

}  // namespace quasilpv
