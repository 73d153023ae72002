#include "quasilpv/reset_fault.hpp"

#include "quasilpv/failsafe.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {

ResetOutcome request_reset(Link& link, double timeout_s) {
  constexpr std::int64_t kRepeatNs = 100 * kNanosecondsPerMillisecond;
  const std::int64_t end_ns = monotonic_ns() + to_nanoseconds(timeout_s);
  ResetOutcome outcome = ResetOutcome::kSilent;
  for (std::int64_t now_ns = monotonic_ns(); now_ns < end_ns; now_ns = monotonic_ns()) {
    link.send(EventCode::kReset, 0);
    const std::int64_t repeat_ns = now_ns + kRepeatNs;
    for (; now_ns < repeat_ns; now_ns = monotonic_ns()) {
      command_v1 command;
      link.receive(repeat_ns - now_ns);
      if (!link.take(command)) {
        continue;
      }
      if (command.state != static_cast<std::int32_t>(ControllerState::kFault)) {
        return ResetOutcome::kLeft;
      }
      outcome = ResetOutcome::kStillFault;
    }
  }
  return outcome;
}

}  // namespace quasilpv
