// The one interface of all control laws, and the factory that binds an artifact to its law.
#pragma once

#include <memory>

#include "quasilpv/artifact.hpp"
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
  /// first valid measurement finds the joints at `speed`, rad/s. RT-SAFE (bounded, no allocation, no lock, no throw).
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

/// Law of Dehak 2022, chapter IV, in acceleration coordinates and discrete time. INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const DobAccelerationParameters& parameters, const LawSettings& settings);
/// Law of Dehak 2022, Theorem IV.11, in torque coordinates with scheduled gains. INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const DobTorqueParameters& parameters, const LawSettings& settings);
/// H-infinity PI tracking, Dehak 2022, Theorem III.10. INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const HinfTrackingParameters& parameters, const LawSettings& settings);
/// Scheduled state feedback, Dehak 2022, Theorem I.2; with a smaller schedule, (III.25). INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const StateFeedbackParameters& parameters, const LawSettings& settings);
/// Descriptor feedback, Dehak 2022, (II.38). INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const DescriptorFeedbackParameters& parameters, const LawSettings& settings);
/// Feedback with a moving window, Dehak 2022, (II.49) and (II.69). INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const DelayedFeedbackParameters& parameters, const LawSettings& settings);
/// PID with feedforward, Dehak 2022 (III.54). INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const PidParameters& parameters, const LawSettings& settings);
/// Computed torque with and without disturbance observer, Dehak 2022 (III.56). INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const ComputedTorqueParameters& parameters, const LawSettings& settings);

/// Dispatches once on the kind and the number of joints. INIT-ONLY.
std::unique_ptr<ControlLaw> make_law(const Artifact& artifact);

}  // namespace quasilpv
