// The output stage: what the law asked for, made safe for the actuators.
#pragma once

#include <cstdint>

#include "quasilpv/step.hpp"

namespace quasilpv {

/// No torque is larger: no limit of an artifact, and at the plant no command.
inline constexpr double kLargestTorqueNm = 1e12;

/// Limits of one arm, all > 0; entries from the number of joints on are unused.
struct TorqueLimits {
  JointArray torque_nm{};
  JointArray slew_nm_per_s{};
};

/// In this fixed order: finite check, saturation to +-torque_nm, limit of the change since the last applied torque to
/// slew_nm_per_s * T, finite check. The first torque has no predecessor and is only saturated, unless take_over() gave
/// it one.
class Limiter {
 public:
  /// INIT-ONLY.
  Limiter(const TorqueLimits& limits, double sample_period_s, int joints);

  /// If any joint's command is not finite, the last torque (zero at first) is kept for all joints.
  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  /// \param commanded N m.
  /// \param[out] applied N m; entries from the number of joints on are zero.
  /// \returns kTorqueSaturated, kSlewLimited and kTorqueNotFinite bits of StepFlag.
  std::uint32_t apply(const JointArray& commanded, JointArray& applied) noexcept;

  /// The same if `commanded`; otherwise the plant holds the last torque, and so does this. RT-SAFE.
  std::uint32_t apply(const JointArray& torque, bool commanded, JointArray& applied) noexcept;

  /// The torque applied last, zero before the first. RT-SAFE.
  const JointArray& last_applied() const noexcept { return last_; }

  /// Forgets the last torque. RT-SAFE.
  void reset() noexcept;

  /// Begins at a torque that is already in force: the slew limit holds from there. RT-SAFE. \param in_force N m,
  /// finite; saturated here.
  void take_over(const JointArray& in_force) noexcept;

 private:
  bool is_finite(const JointArray& torque) const noexcept;

  TorqueLimits limits_;
  JointArray max_change_{};
  std::size_t joints_;
  JointArray last_{};
  bool started_ = false;
};

}  // namespace quasilpv
