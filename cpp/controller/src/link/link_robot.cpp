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

template <class Message, class Reading>
bool read_message(Link& link, Reading& reading) noexcept {
  Message message;
  const bool taken = link.take(message);
  if (taken) {
    reading = to_reading(message);
  }
  return taken;
}

bool take(Link& link, RobotReading& reading) noexcept { return read_message<measurement_v3>(link, reading); }
bool take(Link& link, SystemReading& reading) noexcept { return read_message<signals_measurement_v1>(link, reading); }

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

SystemReading to_reading(const signals_measurement_v1& message) noexcept {
  SystemReading reading;
  reading.seq = message.seq;
  reading.taken_ns = message.utime * kNanosecondsPerMicrosecond;
  std::copy(std::begin(message.value), std::end(message.value), reading.value.begin());
  return reading;
}

signals_command_v1 to_message(const SystemCommand& command) noexcept {
  signals_command_v1 message{};
  message.seq = command.seq;
  message.state = static_cast<std::int32_t>(command.state);
  message.flags = static_cast<std::int32_t>(command.flags);
  std::copy(command.input.begin(), command.input.end(), message.input);
  return message;
}

template <class Reading, class Command>
bool LinkPort<Reading, Command>::read(Reading& reading, std::int64_t timeout_ns) noexcept {
  link_.receive(timeout_ns);
  return take(link_, reading);
}

template <class Reading, class Command>
void LinkPort<Reading, Command>::write(const Command& command) noexcept {
  link_.send(to_message(command));
}

template <class Reading, class Command>
RobotRequest LinkPort<Reading, Command>::take_request() noexcept {
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

template <class Reading, class Command>
FaultCause LinkPort<Reading, Command>::take_fault() noexcept {
  notice_conflict();
  return std::exchange(fault_, FaultCause::kNone);
}

template <class Reading, class Command>
void LinkPort<Reading, Command>::notice_conflict() noexcept {
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

template <class Reading, class Command>
void LinkPort<Reading, Command>::announce(ControllerNews news, std::int64_t seq, FaultCause cause) noexcept {
  link_.send(event_code(news), std::max<std::int64_t>(seq, 0), static_cast<std::int64_t>(cause));
}

template class LinkPort<RobotReading, RobotCommand>;
template class LinkPort<SystemReading, SystemCommand>;

}  // namespace quasilpv
