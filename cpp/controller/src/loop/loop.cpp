#include "quasilpv/loop.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "quasilpv/errors.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {
namespace {

void add(const Reference& offset, Reference& reference) noexcept {
  for (std::size_t j = 0; j < kMaxJoints; ++j) {
    reference.angle[j] += offset.angle[j];
    reference.speed[j] += offset.speed[j];
    reference.acceleration[j] += offset.acceleration[j];
  }
}

}  // namespace

ControlLoop::ControlLoop(const Artifact& artifact, const Trajectory& trajectory, const LoopSettings& settings)
    : controller_(artifact),
      trajectory_(trajectory),
      settings_(settings),
      safe_torque_(artifact, settings.safe_action),
      monitor_(artifact),
      plausibility_(artifact),
      proved_limits_(artifact),
      joining_(artifact),
      bumpless_(settings.bumpless_start) {
  if (trajectory.joints() != artifact.joints()) {
    throw InputError("trajectory '" + trajectory.name() + "'", "joints", std::to_string(trajectory.joints()),
                     std::to_string(artifact.joints()) + " as in artifact '" + artifact.name() + "'");
  }
  telemetry_.premises = artifact.law().model.premises.outputs();
  telemetry_.realtime = settings.realtime;
}

void ControlLoop::handle(const RobotReading& reading, const SampleConditions& conditions) noexcept {
  if (refusal_) {
    return;
  }
  if (started()) {
    predict_missing(reading.seq, conditions);
  }
  StepInput input;
  input.seq = reading.seq;
  input.angle = reading.angle_rad;
  input.speed = reading.speed_rad_s;
  input.gears = reading.gears;
  controller_.choose_angle(input);
  input.valid = accept(input);
  if (refusal_) {
    refuse_start(reading.seq, conditions.now_ns);
    return;
  }
  step(input, conditions, false);
}

bool ControlLoop::accept(const StepInput& reading) noexcept {
  const JointArray& angle = reading.angle;
  implausible_ = false;
  if (!reading.valid ||
      !std::all_of(angle.begin(), angle.begin() + joints(), [](double value) { return std::isfinite(value); })) {
    return false;
  }
  const bool follows = plausibility_.can_follow(reading.seq, angle);
  std::optional<StartRefusal> refusal;
  if (start_ == Start::kAwaited || state() == ControllerState::kFault) {  // what follows is a start
    refusal = plausibility_.refuse_start(angle, path(reading.seq).angle);
  }
  if (refusal && !plausibility_.has_accepted()) {
    refusal_ = refusal;
  }
  const bool accepted = follows && !refusal && plausibility_.can_be_speed(reading.speed);
  // After a fault the arm moves while nobody controls it: the next reading is compared with this one, whatever it is.
  if (accepted || state() == ControllerState::kFault) {
    plausibility_.accept(reading.seq, angle);
  } else {
    plausibility_.refuse();
  }
  implausible_ = !accepted;
  return accepted;
}

void ControlLoop::refuse_start(std::int64_t seq, std::int64_t now_ns) noexcept {
  observed_ = {};
  observed_.start_refused = true;
  failsafe_ = next_state(settings_.failsafe, failsafe_, observed_, now_ns);
  ++faults_;
  last_seq_ = seq;
}

void ControlLoop::advance_start(StepInput& input) noexcept {
  if (input.valid && start_ == Start::kHeld) {
    join(input);
  } else if (input.valid && start_ == Start::kAwaited) {
    start_ = bumpless_ ? Start::kHeld : Start::kOver;
    held_seq_ = input.seq;
    held_angle_ = input.angle;
  }
  if (start_ == Start::kHeld) {
    input.reference.angle = held_angle_;
    input.reference.speed = {};
    input.speed = {};
  } else if (joining_.is_joining(input.seq)) {
    input.joining = true;
    input.offset = joining_.offset(input.seq);
    add(input.offset, input.reference);
  }
}

void ControlLoop::join(const StepInput& input) noexcept {
  const double elapsed_s = static_cast<double>(input.seq - held_seq_) * sample_period_s();
  JointArray speed{};
  JointArray offset{};
  JointArray offset_speed{};
  for (std::size_t j = 0; j < static_cast<std::size_t>(joints()); ++j) {
    speed[j] = (input.angle[j] - held_angle_[j]) / elapsed_s;
    offset[j] = input.angle[j] - input.reference.angle[j];
    offset_speed[j] = speed[j] - input.reference.speed[j];
  }
  controller_.take_over(last_torque_, speed);
  joining_.begin(input.seq, offset, offset_speed);
  start_ = Start::kOver;
}

void ControlLoop::handle_silence(const SampleConditions& conditions) noexcept {
  implausible_ = false;
  StepInput input;
  input.seq = last_seq_ + 1;
  input.valid = false;
  step(input, conditions, true);
}

void ControlLoop::predict_missing(std::int64_t next_seq, const SampleConditions& conditions) noexcept {
  // So many missing samples latch a fault: predicting more of them would only delay the answer.
  const std::int64_t missing = next_seq - last_seq_ - 1;
  const std::int64_t predicted = std::min(missing, settings_.failsafe.invalid_limit);
  const std::int64_t first = last_seq_ + 1;
  implausible_ = false;
  for (std::int64_t i = 0; i < predicted; ++i) {
    StepInput input;
    input.seq = first + i;
    input.valid = false;
    input.commanded = false;
    step(input, conditions, false);
  }
}

void ControlLoop::step(const StepInput& sample, const SampleConditions& conditions, bool plant_silent) noexcept {
  StepInput input = sample;
  const std::int64_t start_ns = monotonic_ns();
  input.reference = path(input.seq);
  advance_start(input);
  overrule(input, conditions.now_ns);
  StepReport report = controller_.step(input);
  const std::int64_t step_ns = monotonic_ns() - start_ns;

  step_time_.add(step_ns);
  note_measurement(input, report);
  flags_ |= report.flags;
  last_seq_ = input.seq;
  const std::int64_t faults_before = faults_;
  judge(report, conditions, plant_silent);
  write_command(report, input, conditions.now_ns);
  write_telemetry(input, report, step_ns);
  if (faults_ > faults_before) {
    post_mortem_.keep();
  }
}

void ControlLoop::overrule(StepInput& input, std::int64_t now_ns) noexcept {
  last_valid_angle_ = input.valid ? input.angle : last_valid_angle_;
  last_valid_speed_ = input.valid ? input.speed : JointArray{};  // nothing is known of it now
  if (failsafe_.state == ControllerState::kFault) {
    input.overruled = true;
    input.in_force = safe_torque(now_ns);
  }
}

JointArray ControlLoop::safe_torque(std::int64_t now_ns) const noexcept {
  const FailsafeAction action = action_of(settings_.failsafe, failsafe_, now_ns);
  return safe_torque_.apply(action.safe_share, torque_at_fault_, last_torque_, last_valid_angle_, last_valid_speed_);
}

void ControlLoop::note_measurement(const StepInput& input, StepReport& report) noexcept {
  report.flags |= implausible_ ? kMeasurementImplausible : kStepHealthy;
  if ((report.flags & kMeasurementInvalid) != 0) {
    ++consecutive_invalid_;
    ++predicted_steps_;
    return;
  }
  consecutive_invalid_ = 0;
  plausibility_.estimate(report.estimated_speed);
  const bool too_fast = plausibility_.is_beyond_domain(report.estimated_speed);
  report.flags |= too_fast ? kSpeedBeyondDomain : kStepHealthy;
  consecutive_speeds_ = too_fast ? consecutive_speeds_ + 1 : 0;
  const bool outside = proved_limits_.is_outside(input.angle, report.estimated_speed);
  report.flags |= outside ? kOutsideProof : kStepHealthy;
  consecutive_outside_ = outside ? consecutive_outside_ + 1 : 0;
}

void ControlLoop::judge(const StepReport& report, const SampleConditions& conditions, bool plant_silent) noexcept {
  FailsafeFlags observed;
  observed.consecutive_invalid = consecutive_invalid_;
  observed.consecutive_overruns = conditions.consecutive_overruns;
  observed.consecutive_foreign = conditions.consecutive_foreign;
  observed.premise_outside_box = (report.flags & kPremiseOutsideBox) != 0;
  observed.law_invalid = (report.flags & (kTorqueNotFinite | kModelInvalid)) != 0;
  observed.plant_silent = plant_silent;
  observed.stop_requested = conditions.stop_requested;
  observed.demanded = conditions.demanded;
  observed.measurement_implausible = implausible_;
  observed.consecutive_speeds = consecutive_speeds_;
  observed.consecutive_outside = consecutive_outside_;
  observed_ = observed;
  const bool was_fault = failsafe_.state == ControllerState::kFault;
  failsafe_ = next_state(settings_.failsafe, failsafe_, observed, conditions.now_ns);
  if (!was_fault && failsafe_.state == ControllerState::kFault) {
    torque_at_fault_ = last_torque_;
    ++faults_;
  }
}

bool ControlLoop::reset_fault() noexcept {
  const FailsafeState next = after_reset(settings_.failsafe, failsafe_, observed_);
  if (next.state == failsafe_.state) {
    return false;
  }
  failsafe_ = next;
  controller_.take_over(last_torque_, {});
  joining_.end();
  start_ = Start::kAwaited;
  bumpless_ = true;
  return true;
}

bool ControlLoop::is_safe(std::int64_t now_ns) const noexcept {
  const FailsafeAction action = action_of(settings_.failsafe, failsafe_, now_ns);
  return action.use_safe_torque && action.safe_share >= 1.0;
}

void ControlLoop::write_command(const StepReport& report, const StepInput& input, std::int64_t now_ns) noexcept {
  if (input.overruled) {
    last_torque_ = input.in_force;
  } else if (failsafe_.state == ControllerState::kFault) {  // by this sample: its law did not know
    last_torque_ = safe_torque(now_ns);
  } else {
    last_torque_ = report.torque_applied;
  }
  command_.seq = input.seq;
  command_.state = failsafe_.state;
  command_.flags = report.flags;
  command_.torque_nm = last_torque_;
}

void ControlLoop::write_telemetry(const StepInput& input, const StepReport& report, std::int64_t step_ns) noexcept {
  telemetry_.seq = input.seq;
  telemetry_.state = failsafe_.state;
  telemetry_.flags = report.flags;
  telemetry_.step_ns = step_ns;
  const Reference on_path = path(input.seq);
  telemetry_.reference_angle_rad = on_path.angle;
  telemetry_.reference_speed_rad_s = on_path.speed;
  telemetry_.reference_acceleration_rad_s2 = on_path.acceleration;
  telemetry_.measured_angle_rad = input.angle;
  telemetry_.measured_speed_rad_s = input.speed;
  telemetry_.gears = input.gears;
  telemetry_.estimated_angle_rad = report.estimated_angle;
  telemetry_.estimated_speed_rad_s = report.estimated_speed;
  telemetry_.estimated_disturbance = report.estimated_disturbance;
  telemetry_.filtered_disturbance = report.filtered_disturbance;
  telemetry_.integral_error_rad_s = report.integral_error;
  // In Fault the law runs on beside a robot that it does not move; what it would command then is nobody's torque.
  const bool is_law_in_force = failsafe_.state != ControllerState::kFault;
  telemetry_.commanded_torque_nm = is_law_in_force ? report.torque_commanded : last_torque_;
  telemetry_.applied_torque_nm = last_torque_;
  telemetry_.premise = report.premise;
  const MonitorReport seen = monitor_.observe(input, report);
  telemetry_.membership_sum = seen.membership_sum;
  telemetry_.premise_excess = seen.premise_excess;
  telemetry_.lyapunov_rad2 = seen.lyapunov;
  post_mortem_.add(telemetry_);
  if (ring_ != nullptr) {
    telemetry_.drops = ring_->drops();
    ring_->push(telemetry_);
  }
}

}  // namespace quasilpv
