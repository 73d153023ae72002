#include "quasilpv/link_robot.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

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

/// Why the plant ended; a plant may say only what it can know.
FaultCause cause_of(const event_v2& ended) noexcept {
  for (const FaultCause cause : {FaultCause::kSecondController, FaultCause::kPlantFailed}) {
    if (ended.detail[0] == static_cast<std::int64_t>(cause)) {
      return cause;
    }
  }
  return FaultCause::kNone;
}

}  // namespace

RobotReading to_reading(const measurement_v3& message) noexcept {
  RobotReading reading;
  reading.seq = message.seq;
  reading.taken_ns = message.utime * kNanosecondsPerMicrosecond;
  std::copy(std::begin(message.angle_rad), std::end(message.angle_rad), reading.angle_rad.begin());
  std::copy(std::begin(message.speed_rad_s), std::end(message.speed_rad_s), reading.speed_rad_s.begin());
  reading.gears = gears_of(message);
  return reading;
}

command_v2 to_message(const RobotCommand& command) noexcept {
  command_v2 message{};
  message.seq = command.seq;
  message.state = static_cast<std::int32_t>(command.state);
  message.flags = static_cast<std::int32_t>(command.flags);
  std::copy(command.torque_nm.begin(), command.torque_nm.end(), message.torque_nm);
  return message;
}

bool LinkRobot::read(RobotReading& reading, std::int64_t timeout_ns) noexcept {
  measurement_v3 message;
  link_.receive(timeout_ns);
  if (!link_.take(message)) {
    return false;
  }
  reading = to_reading(message);
  return true;
}

void LinkRobot::write(const RobotCommand& command) noexcept { link_.send(to_message(command)); }

RobotRequest LinkRobot::take_request() noexcept {
  notice_conflict();
  if (refused_) {
    return RobotRequest::kRefuse;
  }
  event_v2 event;
  while (link_.take(event)) {
    const auto code = static_cast<EventCode>(event.code);
    if (code == EventCode::kEnded) {
      fault_ = cause_of(event);
      return RobotRequest::kEnd;
    }
    if (code == EventCode::kReset) {
      return RobotRequest::kResetFault;
    }
  }
  return RobotRequest::kNone;
}

FaultCause LinkRobot::take_fault() noexcept {
  notice_conflict();
  return std::exchange(fault_, FaultCause::kNone);
}

void LinkRobot::notice_conflict() noexcept {
  switch (link_.peers().take_conflict()) {
    case Conflict::kNone:
      break;
    case Conflict::kSecondPlant:
      fault_ = FaultCause::kSecondPlant;
      break;
    case Conflict::kSecondController:
      fault_ = FaultCause::kSecondController;
      break;
    case Conflict::kOtherMode:
    case Conflict::kOtherRate:
      refused_ = true;
      break;
  }
}

void LinkRobot::announce(ControllerNews news, std::int64_t seq, FaultCause cause) noexcept {
  link_.send(event_code(news), std::max<std::int64_t>(seq, 0), static_cast<std::int64_t>(cause));
}

}  // namespace quasilpv
