// The controller's side of a run: waits, answers, gives up in time.
#pragma once

#include <atomic>
#include <cstdint>

#include "quasilpv/latency_histogram.hpp"
#include "quasilpv/loop.hpp"
#include "quasilpv/pacer.hpp"
#include "quasilpv/robot.hpp"
#include "quasilpv/system_loop.hpp"
#include "quasilpv/system_port.hpp"

namespace quasilpv {

struct ControllerRunSettings {
  Pace pace = Pace::kLockStep;
  double timeout_s = 10.0;     ///< without any measurement: end of the run
  double silence_s = 0.02;     ///< real time: without a measurement after the first: fault
  bool exit_on_fault = false;  ///< end the run once the safe command is reached
};

/// How a run ended.
enum class ControllerRunEnd {
  kPlantEnded,      ///< the robot's side said so
  kStopped,         ///< SIGINT or SIGTERM; the safe command was sent
  kFault,           ///< `exit_on_fault`
  kRefused,         ///< the robot's side runs in another way
  kStartRefused,    ///< the first measurement is no start, see ControlLoop::refusal(); no command was sent
  kPlantSilent,     ///< no measurement for `timeout_s`
  kPlantNeverHeard  ///< no measurement at all
};

const char* to_string(ControllerRunEnd end) noexcept;

struct ControllerRunReport {
  ControllerRunEnd end = ControllerRunEnd::kPlantNeverHeard;
  FaultCause robot_fault = FaultCause::kNone;  ///< last reason of the robot's side against the run
  std::int64_t commands = 0;                   ///< sent, repeated ones included
  std::int64_t repeated = 0;                   ///< lock-step: answered again
  std::int64_t resets = 0;                     ///< faults left on request
  std::int64_t deadline_overruns = 0;          ///< real time: answered later than one period after its arrival
  LatencyHistogram arrival;                    ///< `taken_ns` of the reading to wake-up; meaningful on one machine only
  LatencyHistogram response;                   ///< wake-up to command sent
};

/// Answers readings until the run ends. Lock-step: one command per reading, the same one again for a repeated reading.
/// Real time: the newest reading only, never two commands for one reading; when the robot has been silent for
/// `silence_s`, also if a reading has come by then, a latched fault and the safe torque on the grid of the sample
/// period. A stop request ramps to the safe torque, for at most 100 ms, and ends the run. No wait is longer than 10 ms.
/// Never throws; the control path (read, handle, write, telemetry) allocates nothing itself.
///
/// @param stop  set by a signal handler or another thread
ControllerRunReport run_controller(ControlLoop& loop, Robot& robot, const ControllerRunSettings& settings,
                                   const std::atomic<bool>& stop) noexcept;

/// The same of a general system.
ControllerRunReport run_controller(SystemLoop& loop, SystemPort& system, const ControllerRunSettings& settings,
                                   const std::atomic<bool>& stop) noexcept;

}  // namespace quasilpv
