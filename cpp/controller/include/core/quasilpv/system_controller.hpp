// One controller of a general system, stepped once per sample.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "quasilpv/step.hpp"
#include "quasilpv/system_artifact.hpp"
#include "quasilpv/system_observer.hpp"

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
  std::array<double, kMaxStates> state{};      ///< what the law used: measured, or estimated
  double level = 0.0;                          ///< V = x_d' P^-1 x_d of it; at most 1 inside the region
};

/// u = K(z) x_d, limited, x_d measured or estimated. With deviations from the trim throughout; arguments and results
/// are the signals themselves.
class SystemController {
 public:
  /// INIT-ONLY.
  explicit SystemController(SystemArtifact artifact);
  SystemController(const SystemController&) = delete;
  SystemController& operator=(const SystemController&) = delete;

  const SystemArtifact& artifact() const noexcept { return artifact_; }

  /// One step. RT-SAFE (bounded by the programs, no allocation, no lock, no throw).
  /// \param state measured values of all states, in order; those that are not measured are not read.
  /// \param parameter values of all parameters, in order; those the law is not told are not read.
  SystemReport step(const double* state, const double* parameter) noexcept;

  /// What acts from now on instead of the input of the last report, for the observer. RT-SAFE.
  void applied(const double* input) noexcept;

  /// Forgets the last input: the trim; estimates begin as the artifact states. RT-SAFE.
  void reset() noexcept;

  /// The same with these estimates of all differential states, with trim. RT-SAFE.
  void reset(const double* estimate) noexcept;

 private:
  bool read(const double* state, const double* parameter) noexcept;
  bool predict() noexcept;

  SystemArtifact artifact_;
  std::optional<SystemObserver> observer_;
  std::array<double, kMaxSignals> signal_{};
  std::array<double, kMaxInputs> last_{};
  std::array<double, kMaxPremises> premise_{};  // of the last sample, in its box
  bool has_sample_ = false;
  Eigen::MatrixXd gain_;
  Eigen::VectorXd state_;
  Eigen::VectorXd input_;
  Eigen::VectorXd scaled_;  // P^-1 x_d
};

}  // namespace quasilpv
