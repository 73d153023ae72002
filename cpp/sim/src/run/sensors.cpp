#include "quasilpv/sensors.hpp"

#include <cmath>

namespace quasilpv {
namespace {

constexpr double kTwoPi = 6.283185307179586476925286766559;

double quantum(int bits) { return bits > 0 ? std::ldexp(kTwoPi, -bits) : 0.0; }

}  // namespace

double quantise(double value, double quantum) noexcept {
  return quantum > 0.0 ? std::round(value / quantum) * quantum : value;
}

double GaussianNoise::uniform() { return static_cast<double>(generator_() >> 11) * 0x1p-53; }

double GaussianNoise::operator()() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));  // the argument of log is in (0, 1]
  const double phase = kTwoPi * uniform();
  spare_ = radius * std::sin(phase);
  has_spare_ = true;
  return radius * std::cos(phase);
}

Sensors::Sensors(const SensorOptions& options, int joints, double sample_period_s)
    : joints_(joints),
      quantum_(quantum(options.encoder_bits)),
      link_quantum_(quantum(options.link_encoder_bits.value_or(options.encoder_bits))),
      velocity_noise_(options.velocity_noise_rad_s),
      filter_pole_(options.velocity_filter_time_constant_s > 0.0
                       ? std::exp(-sample_period_s / options.velocity_filter_time_constant_s)
                       : 0.0),
      noise_(options.seed) {}

Measurement Sensors::measure(std::int64_t seq, const PlantSample& truth) {
  const JointArray& angle = truth.encoder_angle();
  const JointArray& speed = truth.encoder_speed();
  Measurement measurement;
  measurement.seq = seq;
  for (std::size_t j = 0; j < static_cast<std::size_t>(joints_); ++j) {
    measurement.angle[j] = quantise(angle[j], quantum_);
    const double noisy = velocity_noise_ > 0.0 ? speed[j] + velocity_noise_ * noise_() : speed[j];
    filtered_speed_[j] = started_ ? filter_pole_ * filtered_speed_[j] + (1.0 - filter_pole_) * noisy : noisy;
    measurement.speed[j] = filtered_speed_[j];
  }
  started_ = true;
  measure_gears(truth, measurement.gears);
  return measurement;
}

void Sensors::measure_gears(const PlantSample& truth, GearReading& gears) {
  if (!truth.motors) {
    return;
  }
  gears.available = truth.motors->sensors;
  const double link_quantum = gears.has(kMotorAngle) ? link_quantum_ : quantum_;
  for (std::size_t j = 0; j < static_cast<std::size_t>(joints_); ++j) {
    gears.motor_angle_rad[j] = gears.has(kMotorAngle) ? quantise(truth.motors->angle[j], quantum_) : 0.0;
    gears.link_angle_rad[j] = gears.has(kLinkAngle) ? quantise(truth.angle[j], link_quantum) : 0.0;
    gears.joint_torque_nm[j] = gears.has(kJointTorque) ? sensed_torque(*truth.motors, j) : 0.0;
  }
}

double Sensors::sensed_torque(const MotorSample& motors, std::size_t joint) {
  const double noise = motors.torque_noise[joint];
  const double noisy = noise > 0.0 ? motors.joint_torque[joint] + noise * noise_() : motors.joint_torque[joint];
  return quantise(noisy, motors.torque_quantum[joint]);
}

}  // namespace quasilpv
