#include "quasilpv/system_loop.hpp"

#include <algorithm>
#include <limits>

#include "quasilpv/realtime.hpp"

namespace quasilpv {
namespace {

SignalArray unknown() noexcept {
  SignalArray value;
  value.fill(std::numeric_limits<double>::quiet_NaN());
  return value;
}

/// As FailsafeSettings has it.
std::int64_t premise_fault_ns(double premise_fault_s) noexcept {
  constexpr double kLongest = 9e9;  // in nanoseconds a 64-bit integer
  if (premise_fault_s > kLongest) {
    return 0;
  }
  return premise_fault_s > 0.0 ? static_cast<std::int64_t>(premise_fault_s * 1e9) : -1;
}

}  // namespace

SystemLoop::SystemLoop(const SystemArtifact& artifact, const SystemLoopSettings& settings)
    : controller_(artifact), settings_(settings) {
  for (std::size_t k = 0; k < artifact.inputs().size(); ++k) {
    const SystemSignal& input = artifact.inputs()[k];
    safe_input_[k] = input.trim + std::clamp(0.0, input.low, input.high);
  }
  last_input_ = safe_input_;
  settings_.failsafe.premise_fault_ns = premise_fault_ns(artifact.premise_fault_s());
  telemetry_.realtime = settings.realtime;
}

void SystemLoop::handle(const SystemReading& reading, const SampleConditions& conditions) noexcept {
  // So many missing samples latch a fault: stepping through more of them would only delay the answer.
  const std::int64_t missing = started() ? reading.seq - last_seq_ - 1 : 0;
  const std::int64_t held = std::min(missing, settings_.failsafe.invalid_limit);
  const std::int64_t first = last_seq_ + 1;
  for (std::int64_t i = 0; i < held; ++i) {
    step(first + i, unknown(), conditions, false);
  }
  step(reading.seq, reading.value, conditions, false);
}

void SystemLoop::handle_silence(const SampleConditions& conditions) noexcept {
  step(last_seq_ + 1, unknown(), conditions, true);
}

void SystemLoop::step(std::int64_t seq, const SignalArray& value, const SampleConditions& conditions,
                      bool plant_silent) noexcept {
  const std::int64_t start_ns = monotonic_ns();
  const SystemReport report = controller_.step(value.data(), value.data() + artifact().states().size());
  const std::int64_t step_ns = monotonic_ns() - start_ns;

  step_time_.add(step_ns);
  const bool invalid = (report.flags & kSignalInvalid) != 0;
  consecutive_invalid_ = invalid ? consecutive_invalid_ + 1 : 0;
  held_steps_ += invalid ? 1 : 0;
  if (!invalid) {
    consecutive_outside_ = (report.flags & kOutsideRegion) != 0 ? consecutive_outside_ + 1 : 0;
  }
  flags_ |= report.flags;
  last_seq_ = seq;
  const std::int64_t faults_before = faults_;
  judge(report, conditions, plant_silent);
  write_command(report, seq, conditions.now_ns);
  write_telemetry(report, value, step_ns);
  if (faults_ > faults_before) {
    post_mortem_.keep();
  }
}

void SystemLoop::judge(const SystemReport& report, const SampleConditions& conditions, bool plant_silent) noexcept {
  FailsafeFlags observed;
  observed.consecutive_invalid = consecutive_invalid_;
  observed.consecutive_overruns = conditions.consecutive_overruns;
  observed.consecutive_foreign = conditions.consecutive_foreign;
  observed.premise_outside_box = (report.flags & kSystemPremiseOutside) != 0;
  observed.law_invalid = (report.flags & kInputNotFinite) != 0;
  observed.plant_silent = plant_silent;
  observed.stop_requested = conditions.stop_requested;
  observed.demanded = conditions.demanded;
  observed.consecutive_outside = consecutive_outside_;
  observed_ = observed;
  const bool was_fault = failsafe_.state == ControllerState::kFault;
  failsafe_ = next_state(settings_.failsafe, failsafe_, observed, conditions.now_ns);
  if (!was_fault && failsafe_.state == ControllerState::kFault) {
    input_at_fault_ = last_input_;
    ++faults_;
  }
}

bool SystemLoop::reset_fault() noexcept {
  const FailsafeState next = after_reset(settings_.failsafe, failsafe_, observed_);
  if (next.state == failsafe_.state) {
    return false;
  }
  failsafe_ = next;
  if (!artifact().observer()) {  // whose estimates follow what was applied, which is the better start
    controller_.reset();
  }
  return true;
}

bool SystemLoop::is_safe(std::int64_t now_ns) const noexcept {
  const FailsafeAction action = action_of(settings_.failsafe, failsafe_, now_ns);
  return action.use_safe_torque && action.safe_share >= 1.0;
}

void SystemLoop::write_command(const SystemReport& report, std::int64_t seq, std::int64_t now_ns) noexcept {
  const FailsafeAction action = action_of(settings_.failsafe, failsafe_, now_ns);
  for (std::size_t k = 0; k < artifact().inputs().size(); ++k) {
    const SystemSignal& signal = artifact().inputs()[k];
    const double ramp = (1.0 - action.safe_share) * input_at_fault_[k] + action.safe_share * safe_input_[k];
    last_input_[k] = action.use_safe_torque ? std::clamp(ramp, signal.trim + signal.low, signal.trim + signal.high)
                                            : report.input[k];
  }
  command_.seq = seq;
  command_.state = failsafe_.state;
  command_.flags = report.flags;
  command_.input = last_input_;
  controller_.applied(last_input_.data());
}

void SystemLoop::write_telemetry(const SystemReport& report, const SignalArray& value, std::int64_t step_ns) noexcept {
  telemetry_.seq = last_seq_;
  telemetry_.state = failsafe_.state;
  telemetry_.flags = report.flags;
  telemetry_.step_ns = step_ns;
  for (std::size_t k = 0; k < artifact().states().size(); ++k) {
    telemetry_.measured[k] = artifact().is_measured(k) ? value[k] : report.state[k];
  }
  // In Fault the law runs on beside a plant that it does not move; what it would command then is nobody's input.
  telemetry_.commanded = failsafe_.state != ControllerState::kFault ? report.commanded : last_input_;
  telemetry_.applied = last_input_;
  telemetry_.premise = report.premise;
  telemetry_.level = report.level;
  post_mortem_.add(telemetry_);
  if (ring_ != nullptr) {
    telemetry_.drops = ring_->drops();
    ring_->push(telemetry_);
  }
}

}  // namespace quasilpv
