// The columns of a run: what the plant did and what the controller did. Shared by the in-process loop and both
// programs, so that equal runs give equal files.
#pragma once

#include <cstddef>
#include <cstdint>

#include "quasilpv/monitor.hpp"
#include "quasilpv/plant_sample.hpp"
#include "quasilpv/record.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// Columns of the plant: `angle_rad`, `speed_rad_s`, `acceleration_rad_s2`, `external_torque_nm`; of one with gears
/// that give also `motor_angle_rad` and `joint_torque_nm`.
class PlantColumns {
 public:
  /// INIT-ONLY. `record` must outlive this. Throws InputError if a column exists already.
  PlantColumns(Record& record, int joints, bool has_gears);
  void append(const PlantSample& sample);

 private:
  Record& record_;
  bool has_gears_;
  std::size_t angle_, speed_, acceleration_, external_torque_;
  std::size_t motor_angle_ = 0, joint_torque_ = 0;
};

/// Columns of the controller: `measured_angle_rad`, `measured_speed_rad_s`, `reference_angle_rad`,
/// `reference_speed_rad_s`, `reference_acceleration_rad_s2`, `torque_commanded_nm`, `torque_applied_nm`,
/// `estimated_angle_rad`, `estimated_speed_rad_s`, `estimated_disturbance`, `filtered_disturbance` (rad/s^2 or N m, as
/// the law says), `integral_error_rad_s` and `flags` (StepFlag bits). Of a robot with sensors of its gears also
/// `encoder_angle_rad`, what the reading calls its angle; `available` (GearSensor bits); and of the sensors that it has
/// `measured_motor_angle_rad`, `measured_link_angle_rad`, `measured_joint_torque_nm`.
class StepColumns {
 public:
  /// INIT-ONLY. `record` must outlive this. Throws InputError if a column exists already.
  /// @param sensors  GearSensor bits: those the robot has
  StepColumns(Record& record, int joints, std::uint32_t sensors);
  /// @param encoder_angle  of the reading, before the law's side was chosen
  void append(const StepInput& input, const JointArray& encoder_angle, const StepReport& report);

 private:
  Record& record_;
  std::size_t measured_angle_, measured_speed_;
  std::size_t reference_angle_, reference_speed_, reference_acceleration_;
  std::size_t torque_commanded_, torque_applied_;
  std::size_t estimated_angle_, estimated_speed_, estimated_disturbance_, filtered_disturbance_;
  std::size_t integral_error_, flags_;
  std::uint32_t sensors_;
  std::size_t encoder_angle_ = 0, available_ = 0, motor_angle_ = 0, link_angle_ = 0, joint_torque_ = 0;
};

/// Columns of the monitor: `membership_sum`, `premise_excess`, `lyapunov_rad2`.
class MonitorColumns {
 public:
  /// INIT-ONLY. `record` must outlive this. Throws InputError if a column exists already.
  explicit MonitorColumns(Record& record);
  void append(const MonitorReport& seen);

 private:
  Record& record_;
  std::size_t membership_sum_, premise_excess_, lyapunov_;
};

}  // namespace quasilpv
