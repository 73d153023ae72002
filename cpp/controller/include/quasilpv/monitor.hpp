// What a run is watched by, beside the law: whether the polytope that the proof speaks of still describes the arm.
#pragma once

#include "quasilpv/artifact.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// What the monitor saw at one sample. For telemetry only: nothing in the loop depends on it.
struct MonitorReport {
  double membership_sum = 1.0;  ///< sum of the weights of the inertia's vertices after clamping; 1 up to rounding
  double premise_excess = 0.0;  ///< BlockPolytope::excess() before clamping: 0 inside the box
};

/// Watches the premises of the design model, from its own evaluation of their program.
class Monitor {
 public:
  /// INIT-ONLY.
  explicit Monitor(const Artifact& artifact);

  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  /// @param angle  at which the law evaluated its model, rad: measured, or predicted without a measurement
  MonitorReport observe(const JointArray& angle) const noexcept;

 private:
  DesignModel model_;
};

}  // namespace quasilpv
