// A robot that plays given readings and keeps the commands: faults at the hardware seam.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "quasilpv/realtime.hpp"
#include "quasilpv/robot.hpp"

namespace quasilpv::testing {

/// Offers its readings one by one, as fast as they are answered, and then ends the run.
class ScriptedRobot final : public Robot {
 public:
  explicit ScriptedRobot(std::vector<RobotReading> readings) : readings_(std::move(readings)) {}

  bool read(RobotReading& reading, std::int64_t /*timeout_ns*/) noexcept override {
    if (next_ == readings_.size()) {
      return false;
    }
    reading = readings_[next_++];
    return true;
  }

  void write(const RobotCommand& command) noexcept override {
    sleep_until(monotonic_ns() + write_ns_);
    commands_.push_back(command);
  }

  RobotRequest take_request() noexcept override {
    return next_ == readings_.size() ? RobotRequest::kEnd : RobotRequest::kNone;
  }

  std::int64_t take_longest_foreign_run() noexcept override { return std::exchange(foreign_run_, 0); }

  /// Every write() takes this long.
  void slow_down(std::int64_t write_ns) { write_ns_ = write_ns; }
  /// Foreign messages before the next reading.
  void set_foreign_run(std::int64_t messages) { foreign_run_ = messages; }

  const std::vector<RobotCommand>& commands() const { return commands_; }

 private:
  std::vector<RobotReading> readings_;
  std::size_t next_ = 0;
  std::int64_t write_ns_ = 0;
  std::int64_t foreign_run_ = 0;
  std::vector<RobotCommand> commands_;
};

}  // namespace quasilpv::testing
