// The one interface of all control laws.
#pragma once

#include "quasilpv/limiter.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// A law with its state, for a number of joints fixed at compile time.
class ControlLaw {
 public:
  virtual ~ControlLaw() = default;
  ControlLaw(const ControlLaw&) = delete;
  ControlLaw& operator=(const ControlLaw&) = delete;

  /// One sample. Until the first valid measurement there is nothing to control with: the torque is zero and the flag
  /// kMeasurementInvalid is set. RT-SAFE (bounded, no allocation, no lock, no throw).
  virtual StepReport step(const StepInput& input) noexcept = 0;

  /// Forgets all state. RT-SAFE (bounded, no allocation, no lock, no throw).
  virtual void reset() noexcept = 0;

  /// Forgets all state, for a robot that moves already: the slew limit holds from the torque in force, N m, and the
  /// first valid measurement finds the joints at `speed`, rad/s. A law that observes angle, speed and disturbance
  /// keeps what it measured of the disturbance. RT-SAFE (bounded, no allocation, no lock, no throw).
  virtual void take_over(const JointArray& in_force, const JointArray& speed) noexcept = 0;

 protected:
  ControlLaw() = default;
};

/// What a law needs from the artifact besides its own parameters.
struct LawSettings {
  double sample_period_s = 0.0;
  int joints = 0;
  TorqueLimits limits;
};

}  // namespace quasilpv
