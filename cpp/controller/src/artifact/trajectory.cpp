#include "quasilpv/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "document/document.hpp"

namespace quasilpv {
namespace {

constexpr std::size_t kPowers = 6;
constexpr double kContinuityTolerance = 1e-9;

// r, r', r'' of sum c_i tau^i, by Horner's rule.
std::array<double, 3> evaluate_quintic(const double* c, double tau) noexcept {
  const double angle = c[0] + tau * (c[1] + tau * (c[2] + tau * (c[3] + tau * (c[4] + tau * c[5]))));
  const double speed = c[1] + tau * (2.0 * c[2] + tau * (3.0 * c[3] + tau * (4.0 * c[4] + tau * 5.0 * c[5])));
  const double acceleration = 2.0 * c[2] + tau * (6.0 * c[3] + tau * (12.0 * c[4] + tau * 20.0 * c[5]));
  return {angle, speed, acceleration};
}

std::vector<double> parse_knots(const Field& field) {
  if (field.size() < 2) {
    field.fail(std::to_string(field.size()) + " knots", "at least 2");
  }
  std::vector<double> knots = field.numbers(field.size());
  if (knots.front() != 0.0) {
    field.at(0).fail(canonical_number(knots.front()), "0");
  }
  for (std::size_t s = 1; s < knots.size(); ++s) {
    if (knots[s] <= knots[s - 1]) {
      field.at(s).fail(canonical_number(knots[s]), "more than the knot before it, " + canonical_number(knots[s - 1]));
    }
  }
  return knots;
}

std::vector<double> parse_coefficients(const Field& field, std::size_t segments, std::size_t joints) {
  if (field.size() != segments) {
    field.fail(std::to_string(field.size()) + " segments", std::to_string(segments) + ", one less than knots_s");
  }
  std::vector<double> coefficients;
  coefficients.reserve(segments * joints * kPowers);
  for (std::size_t s = 0; s < segments; ++s) {
    const Field segment = field.at(s);
    if (segment.size() != joints) {
      segment.fail(std::to_string(segment.size()) + " joints", std::to_string(joints));
    }
    for (std::size_t j = 0; j < joints; ++j) {
      const std::vector<double> polynomial = segment.at(j).numbers(kPowers);
      coefficients.insert(coefficients.end(), polynomial.begin(), polynomial.end());
    }
  }
  return coefficients;
}

void check_continuity(const Field& field, const std::vector<double>& knots, const std::vector<double>& coefficients,
                      std::size_t joints) {
  static constexpr std::array<const char*, 3> kNames = {"angle", "speed", "acceleration"};
  for (std::size_t s = 1; s + 1 < knots.size(); ++s) {
    for (std::size_t j = 0; j < joints; ++j) {
      const double* before = &coefficients[((s - 1) * joints + j) * kPowers];
      const std::array<double, 3> left = evaluate_quintic(before, knots[s] - knots[s - 1]);
      const std::array<double, 3> right = evaluate_quintic(before + joints * kPowers, 0.0);
      for (std::size_t d = 0; d < left.size(); ++d) {
        const double size = std::max({1.0, std::abs(left[d]), std::abs(right[d])});
        if (!(std::abs(left[d] - right[d]) <= kContinuityTolerance * size)) {
          field.at(s).at(j).fail(kNames[d] + std::string(" ") + Json(right[d]).dump() + " at its start",
                                 Json(left[d]).dump() + " as at the end of the segment before");
        }
      }
    }
  }
}

}  // namespace

Trajectory Trajectory::load(const std::string& path) { return parse(read_file(path), path); }

Trajectory Trajectory::parse(std::string_view bytes, const std::string& source) {
  const Json document = parse_document(bytes, source);
  const Field root(document, source, "");
  root["schema"].expect_text("quasilpv.trajectory");
  root["schema_version"].integer(1, 1);
  root.only({"schema", "schema_version", "hash", "name", "joints", "task", "knots_s", "coefficients"});
  if (!root["task"].json().is_object() && !root["task"].is_null()) {
    root["task"].fail("another type", "an object or null");
  }

  Trajectory trajectory;
  trajectory.name_ = root["name"].text();
  trajectory.hash_ = root["hash"].text();
  trajectory.joints_ = static_cast<int>(root["joints"].integer(1, kMaxJoints));
  trajectory.knots_ = parse_knots(root["knots_s"]);
  const auto joints = static_cast<std::size_t>(trajectory.joints_);
  trajectory.coefficients_ = parse_coefficients(root["coefficients"], trajectory.knots_.size() - 1, joints);
  check_continuity(root["coefficients"], trajectory.knots_, trajectory.coefficients_, joints);
  return trajectory;
}

Reference Trajectory::evaluate(double time_s) const noexcept {
  const double time = time_s > 0.0 ? std::min(time_s, knots_.back()) : 0.0;  // NaN is taken for the start
  const auto next = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, time);
  const auto segment = static_cast<std::size_t>(next - knots_.begin()) - 1;
  const bool moving = time_s >= 0.0 && time_s <= knots_.back();

  Reference reference;
  const auto joints = static_cast<std::size_t>(joints_);
  for (std::size_t j = 0; j < joints; ++j) {
    const double* polynomial = &coefficients_[(segment * joints + j) * kPowers];
    const std::array<double, 3> value = evaluate_quintic(polynomial, time - knots_[segment]);
    reference.angle[j] = value[0];
    reference.speed[j] = moving ? value[1] : 0.0;
    reference.acceleration[j] = moving ? value[2] : 0.0;
  }
  return reference;
}

}  // namespace quasilpv
