// What a proof assumes of the angles and speeds of a robot in space, and whether it holds.
#pragma once

#include <array>
#include <cstddef>

#include "quasilpv/artifact.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// The angles and speeds within which the proof of an artifact says something.
///
/// * **Angles**: of a robot in space, those of the operating domain, over which its inertia is bounded; of a law with
///   motion limits, those. A joint with an interval of a whole turn or more is free: the proof holds at all its angles.
/// * **Speeds**: those of the motion limits; other proofs do not ask for any.
///
/// Of planar robots the premises tell (kPremiseOutsideBox), so nothing is outside here.
class ProvedLimits {
 public:
  /// INIT-ONLY.
  explicit ProvedLimits(const Artifact& artifact);

  /// Whether a joint is outside, at its measured angle and its estimated speed; false for NaN, which the law refuses by
  /// itself. RT-SAFE (bounded, no allocation, no lock, no throw).
  bool is_outside(const JointArray& angle, const JointArray& estimated_speed) const noexcept;

  /// The angles of a joint. RT-SAFE.
  const Interval& angles(std::size_t joint) const noexcept { return angle_rad_[joint]; }

 private:
  std::size_t joints_;
  std::array<Interval, kMaxJoints> angle_rad_{};
  JointArray speed_rad_s_{};
};

}  // namespace quasilpv
