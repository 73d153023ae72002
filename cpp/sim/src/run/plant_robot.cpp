#include "quasilpv/plant_robot.hpp"

#include "quasilpv/errors.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {

bool PlantRobot::read(RobotReading& reading, std::int64_t /*timeout_ns*/) noexcept {
  if (is_over() || last_read_ == session_.seq()) {
    return false;
  }
  last_read_ = session_.seq();
  const Measurement& measured = session_.measure(last_read_);
  reading = {measured.seq, monotonic_ns(), measured.angle, measured.speed, measured.gears};
  return true;
}

void PlantRobot::write(const RobotCommand& command) noexcept {
  if (is_over() || command.seq != last_read_) {
    return;
  }
  try {
    session_.advance(last_read_, command.torque_nm);
  } catch (const PlantError& error) {
    failure_ = error.what();
  }
}

RobotRequest PlantRobot::take_request() noexcept { return is_over() ? RobotRequest::kEnd : RobotRequest::kNone; }

}  // namespace quasilpv
