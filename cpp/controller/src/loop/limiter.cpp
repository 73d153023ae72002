#include "quasilpv/limiter.hpp"

#include <algorithm>
#include <cmath>

namespace quasilpv {

Limiter::Limiter(const TorqueLimits& limits, double sample_period_s, int joints)
    : limits_(limits), joints_(static_cast<std::size_t>(joints)) {
  for (std::size_t j = 0; j < joints_; ++j) {
    max_change_[j] = limits.slew_nm_per_s[j] * sample_period_s;
  }
}

std::uint32_t Limiter::apply(const JointArray& commanded, JointArray& applied) noexcept {
  applied = last_;
  if (!is_finite(commanded)) {  // std::clamp would let NaN through
    return kTorqueNotFinite;
  }
  std::uint32_t flags = kStepHealthy;
  JointArray limited{};
  for (std::size_t j = 0; j < joints_; ++j) {
    const double saturated = std::clamp(commanded[j], -limits_.torque_nm[j], limits_.torque_nm[j]);
    limited[j] = started_ ? std::clamp(saturated, last_[j] - max_change_[j], last_[j] + max_change_[j]) : saturated;
    flags |= saturated != commanded[j] ? kTorqueSaturated : kStepHealthy;
    flags |= limited[j] != saturated ? kSlewLimited : kStepHealthy;
  }
  if (!is_finite(limited)) {
    return flags | kTorqueNotFinite;
  }
  applied = limited;
  last_ = limited;
  started_ = true;
  return flags;
}

std::uint32_t Limiter::apply(const JointArray& torque, bool commanded, JointArray& applied) noexcept {
  if (commanded) {
    return apply(torque, applied);
  }
  applied = last_;
  return kStepHealthy;
}

void Limiter::reset() noexcept {
  last_ = {};
  started_ = false;
}

void Limiter::take_over(const JointArray& in_force) noexcept {
  reset();
  started_ = true;
  for (std::size_t j = 0; j < joints_; ++j) {
    last_[j] = std::clamp(in_force[j], -limits_.torque_nm[j], limits_.torque_nm[j]);
  }
}

bool Limiter::is_finite(const JointArray& torque) const noexcept {
  return std::all_of(torque.begin(), torque.begin() + static_cast<std::ptrdiff_t>(joints_),
                     [](double value) { return std::isfinite(value); });
}

}  // namespace quasilpv
