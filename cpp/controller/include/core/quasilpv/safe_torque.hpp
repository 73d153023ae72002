// The torque a controller falls back to.
#pragma once

#include <cstdint>

#include "quasilpv/artifact.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

enum class SafeAction {
  kZero,    ///< no torque: joints with friction or brakes of their own
  kGravity  ///< gravity torque minus damping: an arm that would fall
};

/// Safe torque of one robot, and the way to it.
///
///     kZero:     Gamma_safe = 0
///     kGravity:  Gamma_safe = G(y) - D w,   D_j = torque_nm_j / (10 max |speed domain_j|)
///
/// y is the last valid measured angle. D spends a tenth of the torque at the fastest speed of the domain. w is the
/// measured speed. A gravity torque that is not finite counts as 0, and so does a damping torque.
class SafeTorque {
 public:
  /// INIT-ONLY.
  SafeTorque(const Artifact& artifact, SafeAction action);

  /// The mixture (1 - share) from + share Gamma_safe, moved from `last` by at most the slew limit of one sample and
  /// saturated. RT-SAFE (bounded, no allocation, no lock, no throw).
  ///
  /// @param share  0..1, FailsafeAction::safe_share
  /// @param from   torque in force when the fault was latched, N m
  /// @param last   torque of the sample before, N m
  /// @param angle  last valid measured angle, rad
  /// @param speed  measured speed, rad/s; may be anything
  JointArray apply(double share, const JointArray& from, const JointArray& last, const JointArray& angle,
                   const JointArray& speed) const noexcept;

 private:
  DesignModel model_;
  SafeAction action_;
  JointArray torque_limit_;
  JointArray max_change_{};
  JointArray damping_{};
  std::size_t joints_;
};

}  // namespace quasilpv
