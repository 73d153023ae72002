// The driver: what a robot with position encoders and current-controlled motors has to implement.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "bench_drive.hpp"
#include "quasilpv/pacer.hpp"
#include "quasilpv/realtime.hpp"
#include "quasilpv/robot.hpp"

namespace hardware_driver {

/// A robot that is paced by this computer's clock: sample k is read at the grid point k T. A grid point that was missed
/// is a sample that is missing, which the controller predicts.
class DriveRobot final : public quasilpv::Robot {
 public:
  /// `samples` end the run.
  DriveRobot(std::vector<BenchDrive> drives, double sample_period_s, std::int64_t samples)
      : drives_(std::move(drives)),
        period_ns_(quasilpv::to_nanoseconds(sample_period_s)),
        samples_(samples),
        start_ns_(quasilpv::monotonic_ns() + period_ns_),
        pacer_(start_ns_ - period_ns_, period_ns_) {}

  bool read(quasilpv::RobotReading& reading, std::int64_t timeout_ns) noexcept override {
    if (!waiting_) {
      pacer_.next(quasilpv::monotonic_ns());
      waiting_ = true;
    }
    const std::int64_t give_up_ns = quasilpv::monotonic_ns() + timeout_ns;
    if (pacer_.tick_ns() > give_up_ns) {
      quasilpv::sleep_until(give_up_ns);
      return false;
    }
    quasilpv::sleep_until(pacer_.tick_ns());
    waiting_ = false;
    reading.seq = seq_ = (pacer_.tick_ns() - start_ns_) / period_ns_;
    reading.taken_ns = quasilpv::monotonic_ns();
    // What the gears have besides; a robot with one encoder per joint leaves this out.
    reading.gears.available = quasilpv::kMotorAngle | quasilpv::kLinkAngle | quasilpv::kJointTorque;
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      std::int32_t counts = 0;
      reading.angle_rad[j] = drives_[j].read_counts(counts) ? counts / BenchDrive::kCountsPerRad
                                                            : std::numeric_limits<double>::quiet_NaN();
      reading.gears.motor_angle_rad[j] = reading.angle_rad[j];
      reading.gears.link_angle_rad[j] = drives_[j].link_counts() / BenchDrive::kLinkCountsPerRad;
      reading.gears.joint_torque_nm[j] = 1e-3 * drives_[j].torque_mnm();
    }
    return true;
  }

  void write(const quasilpv::RobotCommand& command) noexcept override {
    constexpr double kLimit = BenchDrive::kLargestCurrentMa;
    for (std::size_t j = 0; j < drives_.size(); ++j) {
      const double current_ma = 1e3 * command.torque_nm[j] / BenchDrive::kTorqueConstantNmPerA;
      drives_[j].set_current_ma(static_cast<std::int32_t>(std::lround(std::clamp(current_ma, -kLimit, kLimit))));
    }
  }

  quasilpv::RobotRequest take_request() noexcept override {
    return seq_ + 1 >= samples_ ? quasilpv::RobotRequest::kEnd : quasilpv::RobotRequest::kNone;
  }

  std::vector<BenchDrive>& drives() noexcept { return drives_; }
  std::int64_t skipped_ticks() const noexcept { return pacer_.skipped_ticks(); }

 private:
  std::vector<BenchDrive> drives_;
  std::int64_t period_ns_;
  std::int64_t samples_;
  std::int64_t start_ns_;
  quasilpv::Pacer pacer_;
  bool waiting_ = false;
  std::int64_t seq_ = -1;
};

}  // namespace hardware_driver
