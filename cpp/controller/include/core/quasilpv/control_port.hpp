// The seam between a controller and whatever it controls: readings in, commands out.
#pragma once

#include <cstdint>

#include "quasilpv/failsafe.hpp"

namespace quasilpv {

/// What the other side asks of the controller besides commands.
enum class RobotRequest {
  kNone,
  kEnd,         ///< the run is over
  kResetFault,  ///< leave a latched fault, if its cause is gone
  kRefuse       ///< there can be no run: the two sides do not run in the same way
};

/// What the controller tells besides commands.
enum class ControllerNews { kStarted, kFault, kEnded };

/// What is controlled, as the control thread sees it: a robot (robot.hpp) or a general system (system_port.hpp).
/// run_controller() calls all members from one thread; it never lets a command out that is not finite or beyond the
/// artifact's limits, and it never answers one reading twice (except in lock-step, where a repeated reading is answered
/// with the same command).
///
/// Who writes a driver implements read() and write(). The other side is the pacemaker: read() returns when its next
/// sample is there, be it a field bus cycle or a Pacer on the absolute grid of the monotonic clock. Members may block
/// only as stated, and neither allocate, lock, throw nor log. The drive needs a watchdog of its own: it must come to
/// rest when write() has not been called for a few sample periods, because no code of this library runs after a crash.
///
/// @tparam Reading  with `seq` and `taken_ns`
/// @tparam Command  answers the reading with the same `seq`
template <class Reading, class Command>
class ControlPort {
 public:
  ControlPort() = default;
  virtual ~ControlPort() = default;
  ControlPort(const ControlPort&) = delete;
  ControlPort& operator=(const ControlPort&) = delete;

  /// Waits for a reading not returned before, at most `timeout_ns` (0: polls); may return earlier without one. Several
  /// pending: the newest. Returns whether `reading` was written.
  virtual bool read(Reading& reading, std::int64_t timeout_ns) noexcept = 0;

  /// Hands over the command; does not wait for the drive. A failure is the driver's to count: the drive's own watchdog
  /// handles it.
  virtual void write(const Command& command) noexcept = 0;

  /// The oldest request not taken yet. By default there is none.
  virtual RobotRequest take_request() noexcept { return RobotRequest::kNone; }

  /// Why this run cannot go on, as far as only the other side can know; asked for once per reading, and once more at
  /// the end of a run. By default nothing speaks against it.
  virtual FaultCause take_fault() noexcept { return FaultCause::kNone; }

  /// Longest run of readings since the last call that were not meant for this controller. By default 0: a wire of its
  /// own carries nothing foreign.
  virtual std::int64_t take_longest_foreign_run() noexcept { return 0; }

  /// What happened, at which sample, and why (a FaultCause, or 0). By default nobody listens.
  virtual void announce(ControllerNews /*news*/, std::int64_t /*seq*/, FaultCause /*cause*/) noexcept {}
};

}  // namespace quasilpv
