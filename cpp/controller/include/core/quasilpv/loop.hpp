// The controller between reading and command, with its policy and its telemetry. No transport, no waiting.
#pragma once

#include <cstdint>
#include <optional>

#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"
#include "quasilpv/failsafe.hpp"
#include "quasilpv/joining_segment.hpp"
#include "quasilpv/latency_histogram.hpp"
#include "quasilpv/monitor.hpp"
#include "quasilpv/plausibility.hpp"
#include "quasilpv/post_mortem.hpp"
#include "quasilpv/proved_limits.hpp"
#include "quasilpv/robot.hpp"
#include "quasilpv/safe_torque.hpp"
#include "quasilpv/sample_conditions.hpp"
#include "quasilpv/telemetry_ring.hpp"
#include "quasilpv/trajectory.hpp"

namespace quasilpv {

struct LoopSettings {
  FailsafeSettings failsafe;
  SafeAction safe_action = SafeAction::kZero;
  bool realtime = false;  ///< memory locked and SCHED_FIFO, as telemetry reports it
  /// Begin where the arm is and join the reference from there (JoiningSegment), so that a start away from the
  /// reference, or while the arm moves, is free of bumps; after a reset that is always so. Off: the law is told the
  /// reference as it is, from the first sample on.
  bool bumpless_start = false;
};

/// Turns the reading of sample k into the command of sample k:
///
/// 1. for every sample missing since the last one, a step without measurement (the observer predicts with the torque
///    that the robot held); at most `invalid_limit` of them, because so many latch a fault anyway;
/// 2. which angles does the law control, and are they plausible? If not, it counts like a missing one; if it is the
/// first, the start is refused;
/// 3. reference r(k T), control step, fail-safe policy; in Fault the safe torque replaces the law's.
///
/// A bumpless start takes two valid readings, because one does not tell the speed. At the first, y_0, the law is told
/// that it is on its reference, at rest, with the acceleration of the reference: no error, so its undisturbed first
/// torque. At the second, y_1 after n samples, it starts afresh at y_1 with the speed (y_1 - y_0) / (n T), and the
/// reference joins the path from there. Telemetry has the path.
///
/// Every step, the predicted ones too, leaves a telemetry sample. The command depends on the sequence of readings and
/// on SampleConditions only.
class ControlLoop {
 public:
  using Reading = RobotReading;

  /// INIT-ONLY. Throws InputError if artifact and trajectory differ in the number of joints.
  ControlLoop(const Artifact& artifact, const Trajectory& trajectory, const LoopSettings& settings);

  /// Where telemetry goes; null (at first): nowhere. `ring` must outlive the loop. INIT-ONLY.
  void publish_to(SampleRing* ring) noexcept { ring_ = ring; }

  /// Whether `seq` is newer than the last sample answered: only those may be handled. RT-SAFE.
  bool is_new(std::int64_t seq) const noexcept { return seq > last_seq_; }

  /// Handles a new reading; afterwards command() is that of its sample. RT-SAFE (bounded, no allocation, no lock, no
  /// throw).
  void handle(const RobotReading& reading, const SampleConditions& conditions) noexcept;

  /// Why there was no start, if the first finite reading was outside the operating domain. The state is then Fault and
  /// there is no command: none must be sent.
  const std::optional<StartRefusal>& refusal() const noexcept { return refusal_; }
  bool has_refused() const noexcept { return refusal_.has_value(); }

  /// The next sample without a measurement, because the plant is silent: latches a fault and moves the command towards
  /// the safe torque. RT-SAFE (bounded, no allocation, no lock, no throw).
  void handle_silence(const SampleConditions& conditions) noexcept;

  /// An explicit reset, to be asked for by a person: leaves a latched fault if nothing speaks against it
  /// (after_reset()). The law starts afresh at the next valid reading, without a bump. Returns whether the fault was
  /// left. RT-SAFE (bounded, no allocation, no lock, no throw).
  bool reset_fault() noexcept;

  const RobotCommand& command() const noexcept { return command_; }

  /// The last samples before the last fault; empty if there was none.
  const PostMortem& post_mortem() const noexcept { return post_mortem_; }

  /// Ready until the first measurement. RT-SAFE, as all that follow.
  ControllerState state() const noexcept { return failsafe_.state; }
  FaultCause cause() const noexcept { return failsafe_.cause; }
  bool started() const noexcept { return last_seq_ >= 0; }
  std::int64_t faults() const noexcept { return faults_; }  ///< latched so far, those left by a reset included
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
  enum class Start {
    kAwaited,  // no valid reading yet
    kHeld,     // the first one of a bumpless start was there
    kOver
  };

  Reference path(std::int64_t seq) const noexcept {
    return trajectory_.evaluate(static_cast<double>(seq) * sample_period_s());
  }
  bool accept(const StepInput& reading) noexcept;
  void refuse_start(std::int64_t seq, std::int64_t now_ns) noexcept;
  void advance_start(StepInput& input) noexcept;
  void join(const StepInput& input) noexcept;
  void overrule(StepInput& input, std::int64_t now_ns) noexcept;
  JointArray safe_torque(std::int64_t now_ns) const noexcept;
  void note_measurement(const StepInput& input, StepReport& report) noexcept;
  void step(const StepInput& input, const SampleConditions& conditions, bool plant_silent) noexcept;
  void predict_missing(std::int64_t next_seq, const SampleConditions& conditions) noexcept;
  void judge(const StepReport& report, const SampleConditions& conditions, bool plant_silent) noexcept;
  void write_command(const StepReport& report, const StepInput& input, std::int64_t now_ns) noexcept;
  void write_telemetry(const StepInput& input, const StepReport& report, std::int64_t step_ns) noexcept;

  Controller controller_;
  Trajectory trajectory_;
  LoopSettings settings_;
  SafeTorque safe_torque_;
  Monitor monitor_;
  Plausibility plausibility_;
  ProvedLimits proved_limits_;
  JoiningSegment joining_;
  FailsafeState failsafe_;
  FailsafeFlags observed_;
  RobotCommand command_;
  TelemetrySample telemetry_;
  SampleRing* ring_ = nullptr;
  PostMortem post_mortem_;
  JointArray last_torque_{};
  JointArray torque_at_fault_{};
  JointArray last_valid_angle_{};
  JointArray last_valid_speed_{};
  std::optional<StartRefusal> refusal_;
  Start start_ = Start::kAwaited;
  bool bumpless_ = false;  // the start that is awaited
  std::int64_t held_seq_ = 0;
  JointArray held_angle_{};
  bool implausible_ = false;  // the last reading
  std::int64_t consecutive_speeds_ = 0;
  std::int64_t consecutive_outside_ = 0;
  std::int64_t last_seq_ = -1;
  std::int64_t faults_ = 0;
  std::int64_t consecutive_invalid_ = 0;
  std::int64_t predicted_steps_ = 0;
  std::uint32_t flags_ = kStepHealthy;
  LatencyHistogram step_time_;
};

}  // namespace quasilpv
