// The controller between two messages: measurement in, command and telemetry out. No transport, no waiting.
#pragma once

#include <cstdint>

#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"
#include "quasilpv/failsafe.hpp"
#include "quasilpv/latency_histogram.hpp"
#include "quasilpv/messages.hpp"
#include "quasilpv/safe_torque.hpp"
#include "quasilpv/trajectory.hpp"

namespace quasilpv {

struct LoopSettings {
  FailsafeSettings failsafe;
  SafeAction safe_action = SafeAction::kZero;
  bool realtime = false;  ///< memory locked and SCHED_FIFO, as telemetry reports it
};

/// What only the caller can know about a sample.
struct SampleConditions {
  std::int64_t now_ns = 0;                ///< clock of the fail-safe policy: monotonic, or seq T in lock-step
  std::int64_t consecutive_overruns = 0;  ///< samples before this one that took longer than their period
  std::int64_t consecutive_foreign = 0;   ///< LinkCounters::consecutive_wrong
  bool stop_requested = false;
};

/// Turns the measurement of sample k into the command of sample k:
///
/// 1. for every sample missing since the last one, a step without measurement (the observer predicts); at most
///    `invalid_limit` of them, because so many latch a fault anyway;
/// 2. reference r(k T), control step, fail-safe policy; in Fault the safe torque replaces the law's.
///
/// The command depends on the sequence of measurements and on SampleConditions only.
class ControlLoop {
 public:
  /// INIT-ONLY. Throws InputError if artifact and trajectory differ in the number of joints.
  ControlLoop(const Artifact& artifact, const Trajectory& trajectory, const LoopSettings& settings);

  /// Whether `seq` is newer than the last sample answered: only those may be handled. RT-SAFE.
  bool is_new(std::int64_t seq) const noexcept { return seq > last_seq_; }

  /// Handles a new measurement; afterwards command() and telemetry() are those of its sample. RT-SAFE (bounded, no
  /// allocation, no lock, no throw).
  void handle(const measurement_v1& measurement, const SampleConditions& conditions) noexcept;

  /// The next sample without a measurement, because the plant is silent: latches a fault and moves the command towards
  /// the safe torque. RT-SAFE (bounded, no allocation, no lock, no throw).
  void handle_silence(const SampleConditions& conditions) noexcept;

  const command_v1& command() const noexcept { return command_; }
  telemetry_v1& telemetry() noexcept { return telemetry_; }

  /// Ready until the first measurement. RT-SAFE, as all that follow.
  ControllerState state() const noexcept { return failsafe_.state; }
  FaultCause cause() const noexcept { return failsafe_.cause; }
  bool started() const noexcept { return last_seq_ >= 0; }
  /// Whether the ramp to the safe torque is over at `now_ns`.
  bool is_safe(std::int64_t now_ns) const noexcept;

  std::int64_t last_seq() const noexcept { return last_seq_; }
  std::int64_t steps() const noexcept { return step_time_.count(); }
  std::int64_t predicted_steps() const noexcept { return predicted_steps_; }
  std::uint32_t flags() const noexcept { return flags_; }  ///< union of the StepFlag bits of all steps
  const LatencyHistogram& step_time() const noexcept { return step_time_; }
  double sample_period_s() const noexcept { return controller_.sample_period_s(); }
  int joints() const noexcept { return controller_.joints(); }

 private:
  void step(const StepInput& input, const SampleConditions& conditions, bool plant_silent) noexcept;
  void predict_missing(std::int64_t next_seq, const SampleConditions& conditions) noexcept;
  void judge(const StepReport& report, const SampleConditions& conditions, bool plant_silent) noexcept;
  void write_command(const StepReport& report, const StepInput& input, std::int64_t now_ns) noexcept;
  void write_telemetry(const StepInput& input, const StepReport& report, std::int64_t step_ns) noexcept;

  Controller controller_;
  Trajectory trajectory_;
  LoopSettings settings_;
  SafeTorque safe_torque_;
  FailsafeState failsafe_;
  command_v1 command_{};
  telemetry_v1 telemetry_{};
  JointArray last_torque_{};
  JointArray torque_at_fault_{};
  JointArray last_valid_angle_{};
  std::int64_t last_seq_ = -1;
  std::int64_t consecutive_invalid_ = 0;
  std::int64_t predicted_steps_ = 0;
  std::uint32_t flags_ = kStepHealthy;
  LatencyHistogram step_time_;
};

}  // namespace quasilpv
