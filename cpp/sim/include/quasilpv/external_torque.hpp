// The disturbance of a scenario: a sum of sines added to the joint torques.
#pragma once

#include <vector>

#include "quasilpv/step.hpp"

namespace quasilpv {

/// One term `amplitude * sin(frequency t + phase)` on one joint.
struct SineTorque {
  int joint = 0;  ///< 0 is the first joint
  double amplitude_nm = 0.0;
  double frequency_rad_s = 0.0;
  double phase_rad = 0.0;
};

/// External joint torque (N m) as a continuous function of plant time, without state.
class ExternalTorque {
 public:
  ExternalTorque() = default;
  /// INIT-ONLY. Throws InputError if a term names a joint outside 0..kMaxJoints-1.
  explicit ExternalTorque(std::vector<SineTorque> terms);

  /// Torque on every joint at plant time `time_s`. RT-SAFE (bounded, no allocation, no lock, no throw).
  JointArray at(double time_s) const noexcept;

 private:
  std::vector<SineTorque> terms_;
};

}  // namespace quasilpv
