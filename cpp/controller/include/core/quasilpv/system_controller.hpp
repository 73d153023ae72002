// One controller of a general system, stepped once per sample.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "quasilpv/step.hpp"
#include "quasilpv/system_artifact.hpp"

namespace quasilpv {

/// Fault bits of a step; 0 is healthy.
enum SystemFlag : std::uint32_t {
  kSystemHealthy = 0,
  kSignalInvalid = 1u << 0,         ///< a measured signal is not finite: the last input is kept
  kSystemPremiseOutside = 1u << 1,  ///< a premise was clamped to its box
  kInputSaturated = 1u << 2,        ///< an input at its limit
  kInputNotFinite = 1u << 3,        ///< the law has no finite answer: the last input is kept
  kOutsideRegion = 1u << 4          ///< V > 1: what was proved does not hold here
};

/// Result of one step, in the units of the signals, trim included.
struct SystemReport {
  std::uint32_t flags = kSystemHealthy;
  std::array<double, kMaxInputs> input{};      ///< what the plant gets
  std::array<double, kMaxInputs> commanded{};  ///< before limits
  std::array<double, kMaxPremises> premise{};  ///< after clamping
  double level = 0.0;                          ///< V = x_d' P^-1 x_d; at most 1 inside the region
};

/// u = K(z) x_d, limited. With deviations from the trim throughout; arguments and results are the signals themselves.
class SystemController {
 public:
  /// INIT-ONLY.
  explicit SystemController(SystemArtifact artifact);

  const SystemArtifact& artifact() const noexcept { return artifact_; }

  /// One step. RT-SAFE (bounded by the programs, no allocation, no lock, no throw).
  /// \param state measured values of all states, in order.
  /// \param parameter values of all parameters, in order; those the law is not told are not read.
  SystemReport step(const double* state, const double* parameter) noexcept;

  /// Forgets the last input: the trim. RT-SAFE.
  void reset() noexcept;

 private:
  SystemArtifact artifact_;
  std::array<double, kMaxSignals> signal_{};
  std::array<double, kMaxInputs> last_{};
  Eigen::MatrixXd gain_;
  Eigen::VectorXd state_;
  Eigen::VectorXd input_;
  Eigen::VectorXd scaled_;  // P^-1 x_d
};

}  // namespace quasilpv
