#include "quasilpv/failsafe.hpp"

#include <algorithm>

namespace quasilpv {
namespace {

FaultCause fault_cause(const FailsafeSettings& settings, const FailsafeFlags& flags, std::int64_t outside_ns) noexcept {
  if (flags.stop_requested) {
    return FaultCause::kStopRequested;
  }
  if (flags.demanded != FaultCause::kNone) {
    return flags.demanded;
  }
  if (flags.plant_silent) {
    return FaultCause::kPlantSilent;
  }
  if (flags.start_refused) {
    return FaultCause::kStartRefused;
  }
  if (flags.consecutive_invalid >= settings.invalid_limit) {
    return flags.measurement_implausible ? FaultCause::kMeasurementImplausible : FaultCause::kMeasurementLost;
  }
  if (flags.consecutive_speeds >= settings.speed_limit) {
    return FaultCause::kSpeedBeyondDomain;
  }
  if (flags.consecutive_outside >= settings.outside_limit) {
    return FaultCause::kOutsideProof;
  }
  if (flags.consecutive_overruns > settings.overrun_limit) {
    return FaultCause::kDeadlineOverrun;
  }
  if (flags.consecutive_foreign >= settings.foreign_limit) {
    return FaultCause::kForeignMessages;
  }
  if (settings.premise_fault_ns != 0 && flags.premise_outside_box && outside_ns > settings.premise_fault_ns) {
    return FaultCause::kPremiseOutsideBox;
  }
  return FaultCause::kNone;
}

}  // namespace

const char* to_string(ControllerState state) noexcept {
  switch (state) {
    case ControllerState::kInit:
      return "init";
    case ControllerState::kReady:
      return "ready";
    case ControllerState::kRunning:
      return "running";
    case ControllerState::kDegraded:
      return "degraded";
    case ControllerState::kFault:
      return "fault";
  }
  return "unknown";
}

const char* to_string(FaultCause cause) noexcept {
  switch (cause) {
    case FaultCause::kNone:
      return "none";
    case FaultCause::kMeasurementLost:
      return "measurement lost";
    case FaultCause::kPlantSilent:
      return "plant silent";
    case FaultCause::kDeadlineOverrun:
      return "deadline overrun";
    case FaultCause::kForeignMessages:
      return "foreign messages";
    case FaultCause::kPremiseOutsideBox:
      return "premise outside its box";
    case FaultCause::kStopRequested:
      return "stop requested";
    case FaultCause::kSecondPlant:
      return "second plant on this session";
    case FaultCause::kSecondController:
      return "second controller on this session";
    case FaultCause::kPlantFailed:
      return "plant failed";
    case FaultCause::kMeasurementImplausible:
      return "measurement implausible";
    case FaultCause::kSpeedBeyondDomain:
      return "speed beyond the domain";
    case FaultCause::kStartRefused:
      return "start refused";
    case FaultCause::kOutsideProof:
      return "outside the limits of the proof";
  }
  return "unknown";
}

FailsafeState next_state(const FailsafeSettings& settings, const FailsafeState& state, const FailsafeFlags& flags,
                         std::int64_t now_ns) noexcept {
  FailsafeState next = state;
  if (flags.premise_outside_box && !state.premise_outside_box) {
    next.outside_since_ns = now_ns;
  }
  next.premise_outside_box = flags.premise_outside_box;
  if (state.state == ControllerState::kFault) {
    return next;
  }
  const std::int64_t outside_ns = flags.premise_outside_box ? now_ns - next.outside_since_ns : 0;
  next.cause = fault_cause(settings, flags, outside_ns);
  if (next.cause != FaultCause::kNone) {
    next.state = ControllerState::kFault;
    next.fault_since_ns = now_ns;
    return next;
  }
  const bool degraded = flags.consecutive_invalid > 0 || flags.consecutive_speeds > 0 ||
                        flags.consecutive_outside > 0 || flags.consecutive_overruns > 0 ||
                        flags.consecutive_foreign > 0 || flags.law_invalid || outside_ns > settings.premise_degraded_ns;
  next.state = degraded ? ControllerState::kDegraded : ControllerState::kRunning;
  return next;
}

FailsafeState after_reset(const FailsafeSettings& settings, const FailsafeState& state,
                          const FailsafeFlags& flags) noexcept {
  const bool healthy = flags.consecutive_invalid == 0 && fault_cause(settings, flags, 0) == FaultCause::kNone;
  return state.state == ControllerState::kFault && healthy ? FailsafeState{} : state;
}

FailsafeAction action_of(const FailsafeSettings& settings, const FailsafeState& state, std::int64_t now_ns) noexcept {
  if (state.state != ControllerState::kFault) {
    return {};
  }
  const std::int64_t elapsed_ns = now_ns - state.fault_since_ns;
  if (elapsed_ns >= settings.ramp_ns) {
    return {true, 1.0};
  }
  return {true, static_cast<double>(std::max<std::int64_t>(elapsed_ns, 0)) / static_cast<double>(settings.ramp_ns)};
}

}  // namespace quasilpv
