#include "quasilpv/proved_limits.hpp"

#include <cmath>
#include <limits>

namespace quasilpv {
namespace {

constexpr double kTurn = 6.283185307179586;
constexpr double kAny = std::numeric_limits<double>::infinity();

}  // namespace

ProvedLimits::ProvedLimits(const Artifact& artifact) : joints_(static_cast<std::size_t>(artifact.joints())) {
  const LawParameters& law = artifact.law();
  const MotionLimits* limits = law.motion_limits();
  angle_rad_.fill({-kAny, kAny});
  speed_rad_s_.fill(kAny);
  for (std::size_t j = 0; j < joints_ && law.model.tree; ++j) {
    const Interval& stated = limits != nullptr ? limits->angle_rad[j] : artifact.domain().angle_rad[j];
    if (stated.high - stated.low < kTurn) {
      angle_rad_[j] = stated;
    }
    if (limits != nullptr) {
      speed_rad_s_[j] = limits->speed_rad_s[j];
    }
  }
}

bool ProvedLimits::is_outside(const JointArray& angle, const JointArray& estimated_speed) const noexcept {
  for (std::size_t j = 0; j < joints_; ++j) {
    if (angle[j] < angle_rad_[j].low || angle[j] > angle_rad_[j].high ||
        std::abs(estimated_speed[j]) > speed_rad_s_[j]) {
      return true;
    }
  }
  return false;
}

}  // namespace quasilpv
