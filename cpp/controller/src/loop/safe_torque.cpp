#include "quasilpv/safe_torque.hpp"

#include <algorithm>
#include <cmath>

namespace quasilpv {
namespace {

constexpr double kDampingShare = 0.1;

double finite_or_zero(double value) noexcept { return std::isfinite(value) ? value : 0.0; }

}  // namespace

SafeTorque::SafeTorque(const Artifact& artifact, SafeAction action)
    : model_(artifact.law().model),
      action_(action),
      torque_limit_(artifact.limits().torque_nm),
      joints_(static_cast<std::size_t>(artifact.joints())) {
  for (std::size_t j = 0; j < joints_; ++j) {
    const double fastest = artifact.domain().fastest(j);
    damping_[j] = fastest > 0.0 ? kDampingShare * torque_limit_[j] / fastest : 0.0;
    max_change_[j] = artifact.limits().slew_nm_per_s[j] * artifact.sample_period_s();
  }
}

JointArray SafeTorque::apply(double share, const JointArray& from, const JointArray& last, const JointArray& angle,
                             const JointArray& speed) const noexcept {
  JointArray gravity{};
  if (action_ == SafeAction::kGravity) {
    model_.gravity_at(angle.data(), gravity.data());
  }
  JointArray torque{};
  for (std::size_t j = 0; j < joints_; ++j) {
    const double damping = action_ == SafeAction::kGravity ? finite_or_zero(damping_[j] * speed[j]) : 0.0;
    const double safe = finite_or_zero(gravity[j]) - damping;
    const double wanted = (1.0 - share) * from[j] + share * safe;
    const double reachable = std::clamp(wanted, last[j] - max_change_[j], last[j] + max_change_[j]);
    torque[j] = std::clamp(reachable, -torque_limit_[j], torque_limit_[j]);
  }
  return torque;
}

}  // namespace quasilpv
