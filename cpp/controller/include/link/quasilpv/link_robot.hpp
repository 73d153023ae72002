// What is controlled at the other end of a Link: qlpv-simulator, or a driver in a process of its own.
#pragma once

#include "quasilpv/link.hpp"
#include "quasilpv/robot.hpp"
#include "quasilpv/system_port.hpp"

namespace quasilpv {

/// The ControlPort that speaks the messages of docs/reference/messages.md. read() waits as Link::receive() does, with a
/// system call; a reading that was repeated is returned again, as lock-step wants it.
template <class Reading, class Command>
class LinkPort final : public ControlPort<Reading, Command> {
 public:
  /// `link` is the controller's end and must outlive this. INIT-ONLY.
  explicit LinkPort(Link& link) noexcept : link_(link) {}

  bool read(Reading& reading, std::int64_t timeout_ns) noexcept override;
  void write(const Command& command) noexcept override;
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

using LinkRobot = LinkPort<RobotReading, RobotCommand>;
using LinkSystem = LinkPort<SystemReading, SystemCommand>;

/// The reading in a message. RT-SAFE (bounded, no allocation, no lock, no throw), as all that follow.
RobotReading to_reading(const measurement_v3& message) noexcept;
SystemReading to_reading(const signals_measurement_v1& message) noexcept;

/// The message of a command; Link::send() fills in the rest.
command_v2 to_message(const RobotCommand& command) noexcept;
signals_command_v1 to_message(const SystemCommand& command) noexcept;

}  // namespace quasilpv
