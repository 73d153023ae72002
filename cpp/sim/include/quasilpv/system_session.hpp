// One run of a general system, sample by sample: the side of the loop that the controller does not see.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "quasilpv/equation_plant.hpp"
#include "quasilpv/integrator.hpp"
#include "quasilpv/sensors.hpp"
#include "quasilpv/system_port.hpp"
#include "quasilpv/system_scenario.hpp"

namespace quasilpv {

/// Where a state left its domain, which ends a run.
struct DomainExit {
  double time_s = 0.0;
  int state = 0;  ///< its index
};

/// Plant, integrator, sensors, disturbance and delay of a scenario. The in-process loop and qlpv-simulator drive a
/// system through this class only, so lock-step runs over a transport give the same samples.
///
/// Sample k lives on [t_k, t_{k+1}], t_k = k T: `measure(k)`, then `advance(k, input_k)`. The input of the sample
/// before acts on [t_k, t_k + delay], then input_k; before the first it is the trim. A state outside its domain at t_k
/// makes sample k the last one. RT-UNSAFE throughout.
class SystemSession {
 public:
  /// INIT-ONLY. `artifact` must outlive this. Throws InputError for values that do not fit, PlantError if the algebraic
  /// equations have no solution at the start.
  SystemSession(const SystemArtifact& artifact, const SystemScenario& scenario);

  const SystemArtifact& artifact() const noexcept { return artifact_; }
  double sample_period_s() const noexcept { return artifact_.sample_period_s(); }
  /// Number of samples of the run: those of the scenario, or until a state left its domain.
  std::int64_t samples() const noexcept { return samples_; }
  /// The sample the session stands at, k.
  std::int64_t seq() const noexcept { return seq_; }
  double time_s() const noexcept { return static_cast<double>(seq_) * sample_period_s(); }

  /// What the controller gets to see of sample k = seq(): states that are measured, then the parameters that it knows;
  /// 0 for the others. Repeatable: the noise of a sample is drawn once.
  const SignalArray& measured() const noexcept { return measured_; }
  /// The states at t_k, with trim.
  const std::vector<double>& truth() const noexcept { return truth_; }
  /// The inputs in force, with trim.
  const InputArray& input() const noexcept { return input_; }
  const std::optional<DomainExit>& exit() const noexcept { return exit_; }

  /// Integrates over sample seq() with the delay of the scenario. Throws PlantError if the plant cannot be integrated;
  /// the session is then over.
  void advance(const InputArray& input) { advance(input, delay_s_); }

  /// The same with the delay this command really had, clamped to [0, T] (real time).
  void advance(const InputArray& input, double delay_s);

 private:
  void observe();
  /// The plant under what acts from `from_s` to `to_s`, from one edge of the disturbance to the next.
  void integrate(double from_s, double to_s);
  void set_input(const InputArray& input) noexcept;

  const SystemArtifact& artifact_;
  SystemDisturbance disturbance_;
  EquationPlant plant_;
  std::unique_ptr<Integrator> integrator_;
  SystemSensorOptions sensors_;
  GaussianNoise noise_;
  double delay_s_;
  std::int64_t samples_;
  std::int64_t seq_ = 0;
  Eigen::VectorXd y_;      // deviations from the trim
  Eigen::VectorXd slope_;  // workspace
  std::vector<double> truth_;
  SignalArray measured_{};
  InputArray input_{};
  std::optional<DomainExit> exit_;
};

}  // namespace quasilpv
