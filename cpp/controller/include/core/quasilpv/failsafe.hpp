// The fail-safe policy: when to trust the law, when to warn, when to give up. Pure: no clock, no I/O, no memory of its
// own.
#pragma once

#include <cstdint>

namespace quasilpv {

/// State of a controller, as telemetry and commands carry it.
enum class ControllerState : std::int32_t {
  kInit = 0,      ///< constructed, no transport yet
  kReady = 1,     ///< waits for the first measurement
  kRunning = 2,   ///< the law's torque, nothing to report
  kDegraded = 3,  ///< the law's torque, while something is wrong that it can bridge
  kFault = 4      ///< latched: the safe torque, until an explicit reset
};

/// Why a fault was latched (`event_v2::detail[0]` of EventCode::kFault).
enum class FaultCause : std::int32_t {
  kNone = 0,
  kMeasurementLost = 1,          ///< too many consecutive invalid or missing measurements
  kPlantSilent = 2,              ///< no measurement for too long (real time)
  kDeadlineOverrun = 3,          ///< too many consecutive overruns
  kForeignMessages = 4,          ///< too many consecutive messages of another session or artifact
  kPremiseOutsideBox = 5,        ///< outside the operating domain for too long
  kStopRequested = 6,            ///< SIGINT or SIGTERM: a stop like a fault, but not an error
  kSecondPlant = 7,              ///< two plants speak in this session
  kSecondController = 8,         ///< two controllers speak in this session
  kPlantFailed = 9,              ///< the plant said that it cannot go on
  kMeasurementImplausible = 10,  ///< too many consecutive invalid or missing measurements, the last one implausible
  kSpeedBeyondDomain = 11,       ///< too many consecutive estimated speeds beyond what the domain allows
  kStartRefused = 12,            ///< the first measurement is outside the operating domain: no torque was commanded
  kOutsideProof = 13             ///< too many consecutive samples with a joint outside what the proof assumes
};

const char* to_string(ControllerState state) noexcept;
const char* to_string(FaultCause cause) noexcept;

/// When the policy gives up.
struct FailsafeSettings {
  std::int64_t invalid_limit = 20;                ///< fault at so many consecutive invalid or missing measurements
  std::int64_t speed_limit = 20;                  ///< fault at so many consecutive speeds beyond the domain
  std::int64_t outside_limit = 20;                ///< fault at so many consecutive samples outside the proof's limits
  std::int64_t overrun_limit = 20;                ///< fault above so many consecutive overruns
  std::int64_t foreign_limit = 100;               ///< fault at so many consecutive foreign messages
  std::int64_t premise_degraded_ns = 20'000'000;  ///< degraded when outside the box for longer
  std::int64_t premise_fault_ns = 1'000'000'000;  ///< fault when outside for longer; 0: never; < 0: at once
  std::int64_t ramp_ns = 40'000'000;              ///< from the last torque to the safe torque
};

/// What was observed at one sample. False and 0 are healthy.
struct FailsafeFlags {
  std::int64_t consecutive_invalid = 0;   ///< invalid or missing measurements up to this one
  std::int64_t consecutive_overruns = 0;  ///< samples that took longer than their period, up to this one
  std::int64_t consecutive_foreign = 0;   ///< messages of another session or artifact since the last good one
  bool premise_outside_box = false;
  bool law_invalid = false;  ///< torque or model not finite: the law kept its last torque
  bool plant_silent = false;
  bool stop_requested = false;
  FaultCause demanded = FaultCause::kNone;  ///< why the robot's side says that this run cannot go on
  bool measurement_implausible = false;     ///< the last of the invalid measurements came, but cannot be true
  std::int64_t consecutive_speeds = 0;      ///< estimated speeds beyond what the domain allows, up to this one
  bool start_refused = false;
  std::int64_t consecutive_outside = 0;  ///< samples with a joint outside what the proof assumes, up to this one
};

/// What the policy remembers from one sample to the next.
struct FailsafeState {
  ControllerState state = ControllerState::kReady;
  FaultCause cause = FaultCause::kNone;
  std::int64_t fault_since_ns = 0;
  bool premise_outside_box = false;
  std::int64_t outside_since_ns = 0;
};

/// What to do with the torque of this sample: (1 - safe_share) times the torque before the fault plus safe_share times
/// the safe torque; 0 outside Fault, where the law's torque is used.
struct FailsafeAction {
  bool use_safe_torque = false;
  double safe_share = 0.0;
};

/// One sample of the policy: (state, flags, clock) -> state.
///
/// Ready becomes Running at the first sample. Any flag makes Running Degraded; the first sample without one makes it
/// Running again. The limits of `settings` make it Fault, with the first cause that applies, and Fault stays Fault:
/// only after_reset() leaves it. RT-SAFE (bounded, no allocation, no lock, no throw).
///
/// @param now_ns  any monotonic clock; simulated time in lock-step
FailsafeState next_state(const FailsafeSettings& settings, const FailsafeState& state, const FailsafeFlags& flags,
                         std::int64_t now_ns) noexcept;

/// An explicit reset: Fault becomes Ready if `flags`, those of the last sample, hold no reason to stay, that is no
/// cause of a fault and a valid measurement. Otherwise, and outside Fault, `state` is returned as it is. The time
/// outside the premise box starts anew. RT-SAFE (bounded, no allocation, no lock, no throw).
FailsafeState after_reset(const FailsafeSettings& settings, const FailsafeState& state,
                          const FailsafeFlags& flags) noexcept;

/// What `state` asks for at `now_ns`. RT-SAFE (bounded, no allocation, no lock, no throw).
FailsafeAction action_of(const FailsafeSettings& settings, const FailsafeState& state, std::int64_t now_ns) noexcept;

}  // namespace quasilpv
