// Stands in for the library of a drive's vendor: encoder counts in, current out. Behind it are a rotor and a gear that
// gives, so that the example runs on a desk. A real driver replaces this file and keeps drive_robot.hpp.
#pragma once

#include <cmath>
#include <cstdint>

namespace hardware_driver {

/// One motor with its encoder, a gear with a torque sensor, and an encoder on the link behind it. The rotor moves by
/// one control period per set_current_ma(); the link follows where the gear's spring is at rest under the torque.
class BenchDrive {
 public:
  static constexpr double kCountsPerRad = 1048576.0 / 6.283185307179586;     ///< 20 bits per turn
  static constexpr double kTorqueConstantNmPerA = 25.0;                      ///< gear included
  static constexpr double kLinkCountsPerRad = 131072.0 / 6.283185307179586;  ///< 17 bits per turn
  static constexpr double kStiffnessNmPerRad = 1e4;
  static constexpr std::int32_t kLargestCurrentMa = 60000;

  BenchDrive(double inertia_kg_m2, double angle_rad, double period_s)
      : inertia_kg_m2_(inertia_kg_m2), angle_rad_(angle_rad), period_s_(period_s) {}

  /// False: the encoder did not answer.
  bool read_counts(std::int32_t& counts) noexcept {
    counts = static_cast<std::int32_t>(std::lround(angle_rad_ * kCountsPerRad));
    if (reads_until_unplugged_ > 0) {
      --reads_until_unplugged_;
    }
    return reads_until_unplugged_ != 0;
  }

  std::int32_t link_counts() const noexcept {
    return static_cast<std::int32_t>(std::lround((angle_rad_ - torque_nm_ / kStiffnessNmPerRad) * kLinkCountsPerRad));
  }

  /// What the gear transmits, mN m.
  std::int32_t torque_mnm() const noexcept { return static_cast<std::int32_t>(std::lround(1e3 * torque_nm_)); }

  void set_current_ma(std::int32_t current_ma) noexcept {
    torque_nm_ = kTorqueConstantNmPerA * 1e-3 * static_cast<double>(current_ma);
    const double acceleration = torque_nm_ / inertia_kg_m2_;
    angle_rad_ += period_s_ * speed_rad_s_ + period_s_ * period_s_ / 2.0 * acceleration;
    speed_rad_s_ += period_s_ * acceleration;
  }

  /// From then on the encoder does not answer.
  void unplug_encoder_after(std::int64_t reads) noexcept { reads_until_unplugged_ = reads; }

 private:
  double inertia_kg_m2_;
  double angle_rad_;
  double speed_rad_s_ = 0.0;
  double torque_nm_ = 0.0;
  double period_s_;
  std::int64_t reads_until_unplugged_ = -1;
};

}  // namespace hardware_driver
