#include "quasilpv/reset_fault.hpp"

#include <algorithm>

#include "quasilpv/failsafe.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {

namespace {

template <class Command>
ResetOutcome request_reset_of(Link& link, double timeout_s) {
  constexpr std::int64_t kRepeatNs = 100 * kNanosecondsPerMillisecond;
  const std::int64_t end_ns = monotonic_ns() + to_nanoseconds(timeout_s);
  ResetOutcome outcome = ResetOutcome::kSilent;
  std::int64_t asked_ns = monotonic_ns();  // a command says whom to ask, and about which fault: listen first
  Command command{};
  for (std::int64_t now_ns = asked_ns; now_ns < end_ns; now_ns = monotonic_ns()) {
    link.receive(std::min(end_ns, asked_ns + kRepeatNs) - now_ns);
    const bool heard = link.take(command);
    if (heard && command.state != static_cast<std::int32_t>(ControllerState::kFault)) {
      return ResetOutcome::kLeft;
    }
    const bool first = heard && outcome == ResetOutcome::kSilent;
    outcome = heard ? ResetOutcome::kStillFault : outcome;
    if (first || monotonic_ns() - asked_ns >= kRepeatNs) {
      asked_ns = monotonic_ns();
      link.send(EventCode::kReset, command.seq);
    }
  }
  return outcome;
}

}  // namespace

ResetOutcome request_reset(Link& link, double timeout_s) {
  return link.identity().is_of_system() ? request_reset_of<signals_command_v1>(link, timeout_s)
                                        : request_reset_of<command_v2>(link, timeout_s);
}

}  // namespace quasilpv
