// A robot that costs the control thread nothing, and gives it every trouble: what a run over it allocates, locks or
// asks of the kernel is the controller's own.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>

#include "loop_fixture.hpp"
#include "quasilpv/run_controller.hpp"

namespace quasilpv::testing {

/// Good samples, gaps, bad angles, foreign messages and silences, each with the fault it leads to and its reset. Reads
/// the clock, and otherwise makes no system call, takes no lock and allocates nothing.
template <class Reading, class Command>
class QuietPort : public ControlPort<Reading, Command> {
 public:
  bool read(Reading& reading, std::int64_t /*timeout_ns*/) noexcept override {
    const std::int64_t now_ns = monotonic_ns();
    if (now_ns < silent_until_ns_) {
      return false;
    }
    seq_ += seq_ % 7 == 0 ? 3 : 1;
    if (seq_ % 1000 == 100) {
      silent_until_ns_ = now_ns + 3 * kMillisecond;
    }
    reading.seq = seq_;
    reading.taken_ns = now_ns;
    measure(reading, seq_ % 1000 < 30 ? std::numeric_limits<double>::quiet_NaN() : 0.1);
    return true;
  }

  void write(const Command& /*command*/) noexcept override {}

  RobotRequest take_request() noexcept override {
    if (seq_ >= kSamples) {
      return RobotRequest::kEnd;
    }
    return seq_ % 50 == 0 ? RobotRequest::kResetFault : RobotRequest::kNone;
  }

  std::int64_t take_longest_foreign_run() noexcept override { return seq_ % 1000 == 200 ? 100 : 0; }

 private:
  static constexpr std::int64_t kSamples = 5000;

  static void measure(RobotReading& reading, double second) noexcept {
    reading.angle_rad = kStart;
    reading.angle_rad[1] = second;
  }
  static void measure(SystemReading& reading, double second) noexcept {
    reading.value[0] = 1.1;
    reading.value[1] = second;
  }

  std::int64_t seq_ = 0;
  std::int64_t silent_until_ns_ = 0;
};

using QuietRobot = QuietPort<RobotReading, RobotCommand>;
using QuietSystem = QuietPort<SystemReading, SystemCommand>;

/// The paces of a run.
inline constexpr Pace kPaces[] = {Pace::kLockStep, Pace::kRealTime};

/// A loop with the law `kind`, ready for run_controller().
inline ControlLoop make_loop(const char* kind) {
  LoopSettings settings;
  settings.bumpless_start = true;
  return ControlLoop(artifact(kind), trajectory(), settings);
}

/// The control thread of qlpv-controller over `robot`, from the first reading to the end of the run.
template <class Loop, class Port>
ControllerRunReport run_control_thread(Loop& loop, Port& robot, Pace pace) noexcept {
  static const std::atomic<bool> kNoStop{false};
  ControllerRunSettings settings;
  settings.pace = pace;
  settings.silence_s = 1e-3;
  return run_controller(loop, robot, settings, kNoStop);
}

}  // namespace quasilpv::testing
