// What a run is watched by, beside the law: whether the polytope that the proof speaks of still describes the arm, and
// how far the loop is at least from its reference, in the Lyapunov function of the proof.
#pragma once

#include <limits>
#include <optional>

#include "quasilpv/artifact.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// What the monitor saw at one sample. For telemetry only: nothing in the loop depends on it. A design inertia that is
/// a chain of bodies has neither vertices nor premises to leave.
struct MonitorReport {
  double membership_sum = 1.0;  ///< sum of the weights of the inertia's vertices after clamping; 1 up to rounding
  double premise_excess = 0.0;  ///< BlockPolytope::excess() before clamping: 0 inside the box
  /// Lower bound of the Lyapunov function of the artifact, rad^2 (LyapunovBound); NaN if the artifact has none, or the
  /// sample no valid measurement or reference.
  double lyapunov = std::numeric_limits<double>::quiet_NaN();
};

/// Watches the premises of the design model, from its own evaluation of their program, and the signals of the law.
class Monitor {
 public:
  /// INIT-ONLY.
  explicit Monitor(const Artifact& artifact);

  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  /// @param input  of the step: where the law evaluated its model, unless the measurement is invalid
  /// @param report  of the same step: without a measurement the premises are those of its estimated angles
  MonitorReport observe(const StepInput& input, const StepReport& report) const noexcept;

 private:
  double lyapunov(const LyapunovBound& bound, const StepInput& input, const StepReport& report) const noexcept;

  DesignModel model_;
  std::optional<LyapunovBound> bound_;
  double sample_period_s_;
};

}  // namespace quasilpv
