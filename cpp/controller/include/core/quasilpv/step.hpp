// What goes into one control step and what comes out of it. Plain data, no allocation, trivially copyable.
#pragma once

#include <array>
#include <cstdint>

#include "quasilpv/gear_reading.hpp"

namespace quasilpv {

inline constexpr int kMaxPremises = 32;

/// Interval of one joint.
struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// Reference of one sample: angle (rad), speed (rad/s), acceleration (rad/s^2).
struct Reference {
  JointArray angle{};
  JointArray speed{};
  JointArray acceleration{};
};

/// Input of one step. `speed` is read only by laws that need a measured speed.
struct StepInput {
  std::int64_t seq = 0;
  bool valid = true;      ///< false: no usable measurement; the observer predicts and the step uses its prediction
  bool commanded = true;  ///< false: the torque of this step reaches nobody, the plant holds the last one
  JointArray angle{};     ///< what the law controls; see Controller::choose_angle()
  JointArray speed{};
  Reference reference{};
  GearReading gears{};     ///< what else is measured of joints that give
  bool overruled = false;  ///< whatever the law answers, `in_force` acts until the next sample: the law watches
  JointArray in_force{};   ///< N m
  bool joining = false;    ///< the reference is off its path by `offset` (JoiningSegment)
  Reference offset{};
};

/// Fault bits: 0 is healthy.
enum StepFlag : std::uint32_t {
  kStepHealthy = 0,
  kMeasurementInvalid = 1u << 0,      ///< missing, NaN or infinite measurement: predicted instead
  kPremiseOutsideBox = 1u << 1,       ///< a premise was clamped to its box
  kTorqueSaturated = 1u << 2,         ///< at least one joint at its torque limit
  kSlewLimited = 1u << 3,             ///< at least one joint at its slew limit
  kTorqueNotFinite = 1u << 4,         ///< the law produced NaN or Inf: the last torque was kept
  kReferenceInvalid = 1u << 5,        ///< NaN or Inf in the reference: the last valid reference was kept, at rest
  kModelInvalid = 1u << 6,            ///< gravity not finite or design inertia not positive definite here
  kMeasurementImplausible = 1u << 7,  ///< the measurement cannot be true (Plausibility): predicted instead
  kSpeedBeyondDomain = 1u << 8,  ///< the estimated speed of a joint is beyond what the domain allows (Plausibility)
  kOutsideProof = 1u << 9        ///< angle or estimated speed of a joint outside what the proof assumes (ProvedLimits)
};

/// Result of one step. Disturbances are in the coordinates of the law: torques (N m), or accelerations (rad/s^2).
struct StepReport {
  std::int64_t seq = 0;
  std::uint32_t flags = kStepHealthy;
  JointArray torque_commanded{};  ///< N m, before limits
  JointArray torque_applied{};    ///< N m, after the limits: what the plant gets; StepInput::in_force if overruled
  JointArray estimated_angle{};   ///< corrected estimate at this sample
  JointArray estimated_speed{};
  JointArray estimated_disturbance{};
  JointArray filtered_disturbance{};
  JointArray integral_error{};                 ///< rad s, the value used in this step
  std::array<double, kMaxPremises> premise{};  ///< after clamping
};

}  // namespace quasilpv
