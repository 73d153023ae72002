#include "quasilpv/link_robot.hpp"

#include <algorithm>
#include <iterator>

namespace quasilpv {
namespace {

constexpr std::int64_t kNanosecondsPerMicrosecond = 1000;

EventCode event_code(ControllerNews news) noexcept {
  switch (news) {
    case ControllerNews::kStarted:
      return EventCode::kStarted;
    case ControllerNews::kFault:
      return EventCode::kFault;
    case ControllerNews::kEnded:
      break;
  }
  return EventCode::kEnded;
}

}  // namespace

RobotReading to_reading(const measurement_v1& message) noexcept {
  RobotReading reading;
  reading.seq = message.seq;
  reading.taken_ns = message.utime * kNanosecondsPerMicrosecond;
  std::copy(std::begin(message.angle_rad), std::end(message.angle_rad), reading.angle_rad.begin());
  std::copy(std::begin(message.speed_rad_s), std::end(message.speed_rad_s), reading.speed_rad_s.begin());
  return reading;
}

command_v1 to_message(const RobotCommand& command) noexcept {
  command_v1 message{};
  message.seq = command.seq;
  message.state = static_cast<std::int32_t>(command.state);
  message.flags = static_cast<std::int32_t>(command.flags);
  std::copy(command.torque_nm.begin(), command.torque_nm.end(), message.torque_nm);
  return message;
}

bool LinkRobot::read(RobotReading& reading, std::int64_t timeout_ns) noexcept {
  measurement_v1 message;
  link_.receive(timeout_ns);
  if (!link_.take(message)) {
    return false;
  }
  reading = to_reading(message);
  return true;
}

void LinkRobot::write(const RobotCommand& command) noexcept { link_.send(to_message(command)); }

RobotRequest LinkRobot::take_request() noexcept {
  event_v1 event;
  while (link_.take(event)) {
    const bool from_plant = event.source == static_cast<std::int32_t>(Side::kPlant);
    if (from_plant && event.code == static_cast<std::int32_t>(EventCode::kEnded)) {
      return RobotRequest::kEnd;
    }
    if (event.code == static_cast<std::int32_t>(EventCode::kReset)) {
      return RobotRequest::kResetFault;
    }
  }
  return RobotRequest::kNone;
}

void LinkRobot::announce(ControllerNews news, std::int64_t seq, FaultCause cause) noexcept {
  link_.send(event_code(news), seq, static_cast<std::int64_t>(cause));
}

}  // namespace quasilpv
