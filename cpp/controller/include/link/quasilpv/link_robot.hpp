// A robot at the other end of a Link: qlpv-simulator, or a driver in a process of its own.
#pragma once

#include "quasilpv/link.hpp"
#include "quasilpv/robot.hpp"

namespace quasilpv {

/// The Robot that speaks the messages of docs/reference/messages.md. read() waits as Link::receive() does, with a
/// system call; a reading that was repeated is returned again, as lock-step wants it.
class LinkRobot final : public Robot {
 public:
  /// `link` is the controller's end and must outlive this. INIT-ONLY.
  explicit LinkRobot(Link& link) noexcept : link_(link) {}

  bool read(RobotReading& reading, std::int64_t timeout_ns) noexcept override;
  void write(const RobotCommand& command) noexcept override;
  RobotRequest take_request() noexcept override;
  FaultCause take_fault() noexcept override;
  std::int64_t take_longest_foreign_run() noexcept override { return link_.take_longest_wrong_run(); }
  void announce(ControllerNews news, std::int64_t seq, FaultCause cause) noexcept override;

 private:
  void notice_conflict() noexcept;

  Link& link_;
  FaultCause fault_ = FaultCause::kNone;
  bool refused_ = false;
};

/// The reading in a message. RT-SAFE (bounded, no allocation, no lock, no throw), as the next.
RobotReading to_reading(const measurement_v3& message) noexcept;

/// The message of a command; Link::send() fills in the rest.
command_v2 to_message(const RobotCommand& command) noexcept;

}  // namespace quasilpv
