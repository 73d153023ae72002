// The reference: piecewise quintic polynomials in joint space, from a trajectory document.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "quasilpv/step.hpp"

namespace quasilpv {

/// Immutable reference trajectory r(t), r'(t), r''(t). Format: docs/reference/formats.md
class Trajectory {
 public:
  /// INIT-ONLY. Throws InputError.
  static Trajectory load(const std::string& path);
  static Trajectory parse(std::string_view bytes, const std::string& source);

  /// RT-SAFE (bounded: binary search over the knots). Before 0 the first angles at rest, after the end the last angles
  /// at rest.
  Reference evaluate(double time_s) const noexcept;

  int joints() const noexcept { return joints_; }
  double duration_s() const noexcept { return knots_.back(); }
  const std::string& name() const noexcept { return name_; }
  const std::string& hash() const noexcept { return hash_; }

 private:
  int joints_ = 0;
  std::string name_;
  std::string hash_;
  std::vector<double> knots_;
  std::vector<double> coefficients_;  ///< [segment][joint][power]
};

}  // namespace quasilpv
