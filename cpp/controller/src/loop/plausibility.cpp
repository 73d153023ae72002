#include "quasilpv/plausibility.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "document/document.hpp"

namespace quasilpv {
namespace {

constexpr double kTurn = 6.283185307179586;
constexpr double kWidening = 0.5;  // of an interval, to each side, while the arm moves

bool is_within(double value, const Interval& interval) noexcept {
  return value >= interval.low && value <= interval.high;  // false for NaN
}

Interval around(double centre, double distance) noexcept { return {centre - distance, centre + distance}; }

Interval widened(const Interval& interval) noexcept {
  const double more = kWidening * (interval.high - interval.low);
  return {interval.low - more, interval.high + more};
}

}  // namespace

std::string to_string(const StartRefusal& refusal) {
  const char* what = refusal.about_reference ? "an angle near the reference, " : "an angle of the operating domain, ";
  return "start refused: angle_rad[" + std::to_string(refusal.joint) + "]: got " + canonical_number(refusal.angle_rad) +
         " rad, expected " + what + canonical_number(refusal.expected.low) + " to " +
         canonical_number(refusal.expected.high) + " rad";
}

Plausibility::Plausibility(const Artifact& artifact)
    : joints_(static_cast<std::size_t>(artifact.joints())),
      sample_period_s_(artifact.sample_period_s()),
      reads_speed_(artifact.law().reads_speed()),
      domain_(artifact.domain()),
      proved_limits_(artifact) {
  for (std::size_t j = 0; j < joints_; ++j) {
    fastest_[j] = kSpeedFactor * domain_.fastest(j);
  }
}

bool Plausibility::has_domain(std::size_t joint) const noexcept {
  const Interval& interval = domain_.angle_rad[joint];
  return interval.high - interval.low < kTurn;
}

std::optional<StartRefusal> Plausibility::refuse_start(const JointArray& angle,
                                                       const JointArray& reference) const noexcept {
  for (std::size_t j = 0; j < joints_; ++j) {
    const bool bounded = has_domain(j);
    Interval expected = bounded ? domain_.angle_rad[j] : around(reference[j], kLargestStartDistance);
    expected.low = std::max(expected.low, proved_limits_.angles(j).low);
    expected.high = std::min(expected.high, proved_limits_.angles(j).high);
    if (!is_within(angle[j], expected)) {
      return StartRefusal{static_cast<int>(j), angle[j], expected, !bounded};
    }
  }
  return std::nullopt;
}

bool Plausibility::can_follow(std::int64_t seq, const JointArray& angle) const noexcept {
  if (!accepted_) {
    return true;
  }
  const std::int64_t elapsed = seq - last_seq_;
  const double elapsed_s = static_cast<double>(elapsed) * sample_period_s_;
  const double unseen_s = static_cast<double>(std::max<std::int64_t>(elapsed - refused_, 1)) * sample_period_s_;
  for (std::size_t j = 0; j < joints_; ++j) {
    const double step = angle[j] - last_angle_[j];
    const double surprise = speed_known_ ? step - last_speed_[j] * elapsed_s : 0.0;
    const bool possible = std::abs(step) <= fastest_[j] * elapsed_s + kStepAllowance &&
                          std::abs(surprise) <= fastest_[j] * unseen_s + kStepAllowance;
    if (!possible || (has_domain(j) && !is_within(angle[j], widened(domain_.angle_rad[j])))) {
      return false;
    }
  }
  return true;
}

bool Plausibility::can_be_speed(const JointArray& speed) const noexcept {
  return !reads_speed_ || !is_beyond_domain(speed);
}

bool Plausibility::is_beyond_domain(const JointArray& estimated_speed) const noexcept {
  for (std::size_t j = 0; j < joints_; ++j) {
    if (std::abs(estimated_speed[j]) > fastest_[j]) {  // false for NaN, which the law refuses by itself
      return true;
    }
  }
  return false;
}

void Plausibility::accept(std::int64_t seq, const JointArray& angle) noexcept {
  last_seq_ = seq;
  last_angle_ = angle;
  accepted_ = true;
  refused_ = 0;
  speed_known_ = false;
}

void Plausibility::estimate(const JointArray& speed) noexcept {
  last_speed_ = speed;
  speed_known_ = true;
}

}  // namespace quasilpv
