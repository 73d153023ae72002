// One run of a plant, sample by sample: the side of the loop that the controller does not see.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>

#include "quasilpv/integrator.hpp"
#include "quasilpv/plant.hpp"
#include "quasilpv/plant_sample.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/sensors.hpp"

namespace quasilpv {

/// Plant, integrator, sensors and transport delay of a scenario at one sample period. The in-process loop and
/// qlpv-simulator drive the plant through this class only, so lock-step runs over a transport give the same samples.
///
/// Sample k lives on [t_k, t_{k+1}], t_k = k T: `measure(k)`, then `advance(k, torque_k)`. The torque of the sample
/// before acts on [t_k, t_k + delay], torque_k on [t_k + delay, t_{k+1}] (no torque acts before the first). The
/// integrator restarts at each of these jumps. A delay within 1 ns of 0 or of T counts as 0 or T: a shorter interval
/// cannot be told from a jump. Of every torque the actuators deliver what the scenario's limits let through. RT-UNSAFE
/// throughout.
class PlantSession {
 public:
  /// INIT-ONLY. Throws InputError if `sample_period_s` is not positive, the duration is less than half a sample, or the
  /// transport delay is longer than a sample; PlantError if the initial state is not one of the mechanism.
  PlantSession(const Scenario& scenario, double sample_period_s) : PlantSession(scenario, sample_period_s, {}) {}

  /// The same with an integrator of the caller's instead of the scenario's; an empty factory stands for the scenario's.
  PlantSession(const Scenario& scenario, double sample_period_s, const IntegratorFactory& integrator);

  int joints() const noexcept { return plant_->joints(); }
  double sample_period_s() const noexcept { return sample_period_s_; }
  /// Number of samples of the run, round(duration / T).
  std::int64_t samples() const noexcept { return samples_; }
  /// The sample the session stands at, k; plant time is k T.
  std::int64_t seq() const noexcept { return seq_; }
  /// Control torque in force (N m), what a lost command leaves behind.
  const JointArray& torque() const noexcept { return plant_->torque(); }

  /// Measurement of sample k = seq(). Repeatable: the noise of a sample is drawn once. Throws InputError for another k.
  const Measurement& measure(std::int64_t k) const;

  /// The truth at t_k, as the left limit: accelerations are those of the torque in force *before* torque k acts.
  const PlantSample& truth() const noexcept { return truth_; }

  /// Integrates over sample k = seq() with the delay of the scenario. Throws InputError for another k, PlantError if
  /// the plant cannot be integrated; the session is then over.
  void advance(std::int64_t k, const JointArray& torque) { advance(k, torque, transport_delay_s_); }

  /// The same with the delay this command really had, clamped to [0, T] (real time).
  void advance(std::int64_t k, const JointArray& commanded, double delay_s);

 private:
  void expect_current(std::int64_t k) const;
  void observe(double time_s);
  JointArray delivered(JointArray torque) const noexcept;

  std::unique_ptr<Plant> plant_;
  std::unique_ptr<Integrator> integrator_;
  Sensors sensors_;
  double sample_period_s_;
  double transport_delay_s_;
  std::optional<JointArray> torque_limit_nm_;
  std::int64_t samples_;
  std::int64_t seq_ = 0;
  Eigen::VectorXd state_;
  PlantSample truth_;
  Measurement measurement_;
};

}  // namespace quasilpv
