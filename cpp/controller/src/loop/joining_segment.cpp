#include "quasilpv/joining_segment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace quasilpv {
namespace {

constexpr double kShortestS = 0.02;
constexpr double kSpeedShare = 0.25;
constexpr double kOffsetShare = 0.2;
constexpr double kSpeedOffsetShare = 0.3;
// Largest values on [0, 1] of the derivatives of the two shapes below.
constexpr double kOffsetSpeed = 1.875;
constexpr double kOffsetAcceleration = 5.7735026918962573;  // 10 / sqrt(3)
constexpr double kSpeedAcceleration = 3.9399;
constexpr int kPostures = 500;  // of a chain of bodies, whose inertia has no vertices

double largest_row_sum(const BlockPolytope& inertia, Eigen::Index row) {
  double largest = 0.0;
  for (int vertex = 0; vertex < inertia.vertices(); ++vertex) {
    largest = std::max(largest, inertia.vertex(vertex).row(row).cwiseAbs().sum());
  }
  return largest;
}

// Postures spread evenly over the domain by multiples of the golden ratio's generalisation (Roberts 2018), one root per
// number of joints.
JointArray posture(const Artifact& artifact, int number) {
  double root = 2.0;
  for (int i = 0; i < 60; ++i) {
    root = std::pow(1.0 + root, 1.0 / (artifact.joints() + 1));
  }
  JointArray angle{};
  for (int j = 0; j < artifact.joints(); ++j) {
    const Interval& interval = artifact.domain().angle_rad[static_cast<std::size_t>(j)];
    const double share = std::fmod(0.5 + number * std::pow(root, -(j + 1)), 1.0);
    angle[static_cast<std::size_t>(j)] = interval.low + share * (interval.high - interval.low);
  }
  return angle;
}

double largest_row_sum(const Artifact& artifact, const TreeDynamics& tree, Eigen::Index row) {
  double largest = 0.0;
  for (int number = 0; number < kPostures; ++number) {
    const JointArray angle = posture(artifact, number);
    largest = std::max(largest, tree.inertia(angle.data()).row(row).cwiseAbs().sum());
  }
  return largest;
}

double largest_acceleration(const Artifact& artifact) {
  const DesignModel& model = artifact.law().model;
  double acceleration = std::numeric_limits<double>::infinity();
  for (int row = 0; row < artifact.joints(); ++row) {
    const double limit = artifact.limits().torque_nm[static_cast<std::size_t>(row)];
    const double sum = model.tree ? largest_row_sum(artifact, *model.tree, row) : largest_row_sum(model.inertia, row);
    acceleration = std::min(acceleration, limit / sum);
  }
  return acceleration;
}

}  // namespace

JoiningSegment::JoiningSegment(const Artifact& artifact)
    : joints_(static_cast<std::size_t>(artifact.joints())),
      sample_period_s_(artifact.sample_period_s()),
      acceleration_(largest_acceleration(artifact)) {
  for (std::size_t j = 0; j < joints_; ++j) {
    fastest_[j] = artifact.domain().fastest(j);
  }
}

double JoiningSegment::shortest(double offset, double speed, double fastest) const noexcept {
  return std::max({kShortestS, kOffsetSpeed * offset / (kSpeedShare * fastest),
                   std::sqrt(kOffsetAcceleration * offset / (kOffsetShare * acceleration_)),
                   kSpeedAcceleration * speed / (kSpeedOffsetShare * acceleration_)});
}

void JoiningSegment::begin(std::int64_t seq, const JointArray& offset, const JointArray& offset_speed) noexcept {
  first_seq_ = seq;
  offset_ = offset;
  speed_ = offset_speed;
  duration_s_ = 0.0;
  for (std::size_t j = 0; j < joints_; ++j) {
    duration_s_ = std::max(duration_s_, shortest(std::abs(offset[j]), std::abs(offset_speed[j]), fastest_[j]));
  }
}

bool JoiningSegment::is_joining(std::int64_t seq) const noexcept {
  return static_cast<double>(seq - first_seq_) * sample_period_s_ < duration_s_;
}

// delta = e h(s) + v D g(s) with s = t / D, h = 1 - 10 s^3 + 15 s^4 - 6 s^5 and g = s - 6 s^3 + 8 s^4 - 3 s^5.
Reference JoiningSegment::offset(std::int64_t seq) const noexcept {
  const double D = duration_s_;
  const double s = static_cast<double>(seq - first_seq_) * sample_period_s_ / D;
  const double h = 1.0 + s * s * s * (-10.0 + s * (15.0 - 6.0 * s));
  const double h1 = s * s * (-30.0 + s * (60.0 - 30.0 * s)) / D;
  const double h2 = s * (-60.0 + s * (180.0 - 120.0 * s)) / (D * D);
  const double g = D * s * (1.0 + s * s * (-6.0 + s * (8.0 - 3.0 * s)));
  const double g1 = 1.0 + s * s * (-18.0 + s * (32.0 - 15.0 * s));
  const double g2 = s * (-36.0 + s * (96.0 - 60.0 * s)) / D;
  Reference delta;
  for (std::size_t j = 0; j < joints_; ++j) {
    delta.angle[j] = offset_[j] * h + speed_[j] * g;
    delta.speed[j] = offset_[j] * h1 + speed_[j] * g1;
    delta.acceleration[j] = offset_[j] * h2 + speed_[j] * g2;
  }
  return delta;
}

}  // namespace quasilpv
