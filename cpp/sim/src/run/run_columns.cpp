#include "quasilpv/run_columns.hpp"

namespace quasilpv {

PlantColumns::PlantColumns(Record& record, int joints, bool has_gears) : record_(record), has_gears_(has_gears) {
  const auto width = static_cast<std::size_t>(joints);
  angle_ = record.add_column("angle_rad", width);
  speed_ = record.add_column("speed_rad_s", width);
  acceleration_ = record.add_column("acceleration_rad_s2", width);
  external_torque_ = record.add_column("external_torque_nm", width);
  if (has_gears_) {
    motor_angle_ = record.add_column("motor_angle_rad", width);
    joint_torque_ = record.add_column("joint_torque_nm", width);
  }
}

void PlantColumns::append(const PlantSample& sample) {
  record_.append(angle_, sample.angle);
  record_.append(speed_, sample.speed);
  record_.append(acceleration_, sample.acceleration);
  record_.append(external_torque_, sample.external_torque);
  if (has_gears_) {
    record_.append(motor_angle_, sample.motors->angle);
    record_.append(joint_torque_, sample.motors->joint_torque);
  }
}

StepColumns::StepColumns(Record& record, int joints, std::uint32_t sensors) : record_(record), sensors_(sensors) {
  const auto width = static_cast<std::size_t>(joints);
  measured_angle_ = record.add_column("measured_angle_rad", width);
  measured_speed_ = record.add_column("measured_speed_rad_s", width);
  reference_angle_ = record.add_column("reference_angle_rad", width);
  reference_speed_ = record.add_column("reference_speed_rad_s", width);
  reference_acceleration_ = record.add_column("reference_acceleration_rad_s2", width);
  torque_commanded_ = record.add_column("torque_commanded_nm", width);
  torque_applied_ = record.add_column("torque_applied_nm", width);
  estimated_angle_ = record.add_column("estimated_angle_rad", width);
  estimated_speed_ = record.add_column("estimated_speed_rad_s", width);
  estimated_disturbance_ = record.add_column("estimated_disturbance", width);
  filtered_disturbance_ = record.add_column("filtered_disturbance", width);
  integral_error_ = record.add_column("integral_error_rad_s", width);
  flags_ = record.add_column("flags");
  if (sensors_ != kNoGearSensor) {
    encoder_angle_ = record.add_column("encoder_angle_rad", width);
    available_ = record.add_column("available");
  }
  if ((sensors_ & kMotorAngle) != 0) {
    motor_angle_ = record.add_column("measured_motor_angle_rad", width);
  }
  if ((sensors_ & kLinkAngle) != 0) {
    link_angle_ = record.add_column("measured_link_angle_rad", width);
  }
  if ((sensors_ & kJointTorque) != 0) {
    joint_torque_ = record.add_column("measured_joint_torque_nm", width);
  }
}

void StepColumns::append(const StepInput& input, const JointArray& encoder_angle, const StepReport& report) {
  record_.append(measured_angle_, input.angle);
  record_.append(measured_speed_, input.speed);
  record_.append(reference_angle_, input.reference.angle);
  record_.append(reference_speed_, input.reference.speed);
  record_.append(reference_acceleration_, input.reference.acceleration);
  record_.append(torque_commanded_, report.torque_commanded);
  record_.append(torque_applied_, report.torque_applied);
  record_.append(estimated_angle_, report.estimated_angle);
  record_.append(estimated_speed_, report.estimated_speed);
  record_.append(estimated_disturbance_, report.estimated_disturbance);
  record_.append(filtered_disturbance_, report.filtered_disturbance);
  record_.append(integral_error_, report.integral_error);
  record_.append(flags_, static_cast<double>(report.flags));
  if (sensors_ != kNoGearSensor) {
    record_.append(encoder_angle_, encoder_angle);
    record_.append(available_, static_cast<double>(input.gears.available));
  }
  if ((sensors_ & kMotorAngle) != 0) {
    record_.append(motor_angle_, input.gears.motor_angle_rad);
  }
  if ((sensors_ & kLinkAngle) != 0) {
    record_.append(link_angle_, input.gears.link_angle_rad);
  }
  if ((sensors_ & kJointTorque) != 0) {
    record_.append(joint_torque_, input.gears.joint_torque_nm);
  }
}

MonitorColumns::MonitorColumns(Record& record) : record_(record) {
  membership_sum_ = record.add_column("membership_sum");
  premise_excess_ = record.add_column("premise_excess");
  lyapunov_ = record.add_column("lyapunov_rad2");
}

void MonitorColumns::append(const MonitorReport& seen) {
  record_.append(membership_sum_, seen.membership_sum);
  record_.append(premise_excess_, seen.premise_excess);
  record_.append(lyapunov_, seen.lyapunov);
}

}  // namespace quasilpv
