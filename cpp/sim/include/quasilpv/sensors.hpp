// What the controller gets to see of the plant.
#pragma once

#include <cstdint>
#include <optional>
#include <random>

#include "quasilpv/plant_sample.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// Sensor imperfections of a scenario.
struct SensorOptions {
  int encoder_bits = 0;               ///< 0: exact angles; else the angle is a multiple of 2 pi / 2^bits
  double velocity_noise_rad_s = 0.0;  ///< standard deviation of the white noise on the measured speed
  std::uint64_t seed = 0;
  double velocity_filter_time_constant_s = 0.0;  ///< of the low-pass behind the noise, in the sensor; 0: none
  /// Of encoders on the links, where motors have encoders too; nothing: `encoder_bits`.
  std::optional<int> link_encoder_bits{};
};

/// Joint angles (rad) and speeds (rad/s) as measured at sample `seq`, plant time seq T: those of the motors, of joints
/// with encoders on both sides.
struct Measurement {
  std::int64_t seq = 0;
  JointArray angle{};
  JointArray speed{};
  GearReading gears{};
};

/// The multiple of `quantum` nearest to `value` (ties away from zero); `quantum` = 0 returns `value`.
/// RT-SAFE (bounded, no allocation, no lock, no throw).
double quantise(double value, double quantum) noexcept;

/// Standard normal deviates that are the same on every standard library: std::normal_distribution leaves its algorithm
/// to the implementation, so this is Box and Muller (1958) on the 53 high bits of std::mt19937_64.
class GaussianNoise {
 public:
  explicit GaussianNoise(std::uint64_t seed) : generator_(seed) {}
  double operator()();

 private:
  double uniform();  // in [0, 1)

  std::mt19937_64 generator_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

/// Encoders, torque sensors and noisy, filtered speeds of n joints: v = q v + (1 - q) (w + noise), q = exp(-T / time
/// constant), from the first measured speed on. A torque is rounded behind its noise. Every call to measure() draws new
/// noise, so call it once per sample.
class Sensors {
 public:
  /// INIT-ONLY.
  Sensors(const SensorOptions& options, int joints, double sample_period_s);

  Measurement measure(std::int64_t seq, const PlantSample& truth);

  double angle_quantum_rad() const noexcept { return quantum_; }

 private:
  void measure_gears(const PlantSample& truth, GearReading& gears);
  double sensed_torque(const MotorSample& motors, std::size_t joint);

  int joints_;
  double quantum_;
  double link_quantum_;
  double velocity_noise_;
  double filter_pole_;
  GaussianNoise noise_;
  JointArray filtered_speed_{};
  bool started_ = false;
};

}  // namespace quasilpv
