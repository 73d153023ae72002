// The controller of a general system between reading and command, with its policy and its telemetry. No transport, no
// waiting.
#pragma once

#include <cstdint>
#include <limits>

#include "quasilpv/failsafe.hpp"
#include "quasilpv/latency_histogram.hpp"
#include "quasilpv/post_mortem.hpp"
#include "quasilpv/sample_conditions.hpp"
#include "quasilpv/system_controller.hpp"
#include "quasilpv/system_port.hpp"
#include "quasilpv/system_sample.hpp"

namespace quasilpv {

struct SystemLoopSettings {
  FailsafeSettings failsafe = without_outside_limit();
  bool realtime = false;  ///< memory locked and SCHED_FIFO, as telemetry reports it

  /// Outside the region a system is degraded and no more: its law is still the best there is, while the trim input
  /// leaves the plant alone.
  static FailsafeSettings without_outside_limit() noexcept {
    FailsafeSettings settings;
    settings.outside_limit = std::numeric_limits<std::int64_t>::max();
    return settings;
  }
};

/// Turns the reading of sample k into the command of sample k:
///
/// 1. for every sample missing since the last one, a step without measurement, which holds the last input; at most
///    `invalid_limit` of them, because so many latch a fault anyway;
/// 2. control step; a signal that is not finite counts like a missing measurement, and the input is held;
/// 3. fail-safe policy; in Fault the input moves, within `ramp_ns`, to its trim, or to the limit next to it.
///
/// Every step leaves a telemetry sample. The command depends on the sequence of readings and on SampleConditions only.
class SystemLoop {
 public:
  using Reading = SystemReading;

  /// INIT-ONLY.
  SystemLoop(const SystemArtifact& artifact, const SystemLoopSettings& settings);

  /// Where telemetry goes; null (at first): nowhere. `ring` must outlive the loop. INIT-ONLY.
  void publish_to(SystemRing* ring) noexcept { ring_ = ring; }

  /// Whether `seq` is newer than the last sample answered: only those may be handled. RT-SAFE, as all that follow
  /// (bounded, no allocation, no lock, no throw).
  bool is_new(std::int64_t seq) const noexcept { return seq > last_seq_; }

  /// Handles a new reading; afterwards command() is that of its sample.
  void handle(const SystemReading& reading, const SampleConditions& conditions) noexcept;

  /// A system starts wherever it is: outside its region it is degraded.
  static constexpr bool has_refused() noexcept { return false; }

  /// The next sample without a measurement, because the plant is silent: latches a fault and moves the command towards
  /// the trim input.
  void handle_silence(const SampleConditions& conditions) noexcept;

  /// An explicit reset, to be asked for by a person: leaves a latched fault if nothing speaks against it
  /// (after_reset()). Returns whether the fault was left.
  bool reset_fault() noexcept;

  const SystemCommand& command() const noexcept { return command_; }

  /// The last samples before the last fault; empty if there was none.
  const LastSamples<SystemSample>& post_mortem() const noexcept { return post_mortem_; }

  ControllerState state() const noexcept { return failsafe_.state; }  ///< Ready until the first measurement
  FaultCause cause() const noexcept { return failsafe_.cause; }
  bool started() const noexcept { return last_seq_ >= 0; }
  std::int64_t faults() const noexcept { return faults_; }  ///< latched so far, those left by a reset included
  /// Whether the ramp to the trim input is over at `now_ns`.
  bool is_safe(std::int64_t now_ns) const noexcept;

  std::int64_t last_seq() const noexcept { return last_seq_; }
  std::int64_t steps() const noexcept { return step_time_.count(); }
  std::int64_t predicted_steps() const noexcept { return held_steps_; }  ///< without a valid measurement
  std::uint32_t flags() const noexcept { return flags_; }                ///< union of the SystemFlag bits of all steps
  const LatencyHistogram& step_time() const noexcept { return step_time_; }
  double sample_period_s() const noexcept { return controller_.artifact().sample_period_s(); }
  const SystemArtifact& artifact() const noexcept { return controller_.artifact(); }

 private:
  void step(std::int64_t seq, const SignalArray& value, const SampleConditions& conditions, bool plant_silent) noexcept;
  void judge(const SystemReport& report, const SampleConditions& conditions, bool plant_silent) noexcept;
  void write_command(const SystemReport& report, std::int64_t seq, std::int64_t now_ns) noexcept;
  void write_telemetry(const SystemReport& report, const SignalArray& value, std::int64_t step_ns) noexcept;

  SystemController controller_;
  SystemLoopSettings settings_;
  InputArray safe_input_{};
  FailsafeState failsafe_;
  FailsafeFlags observed_;
  SystemCommand command_;
  SystemSample telemetry_;
  SystemRing* ring_ = nullptr;
  LastSamples<SystemSample> post_mortem_;
  InputArray last_input_{};
  InputArray input_at_fault_{};
  std::int64_t last_seq_ = -1;
  std::int64_t faults_ = 0;
  std::int64_t consecutive_invalid_ = 0;
  std::int64_t consecutive_outside_ = 0;
  std::int64_t held_steps_ = 0;
  std::uint32_t flags_ = kSystemHealthy;
  LatencyHistogram step_time_;
};

}  // namespace quasilpv
