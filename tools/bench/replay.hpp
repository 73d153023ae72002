// One open-loop run solved by several integrators: their CPU time and error.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "difference_quotient_plant.hpp"
#include "quasilpv/ida_integrator.hpp"
#include "quasilpv/rk4_integrator.hpp"
#include "quasilpv/scenario.hpp"
#include "timing.hpp"

namespace quasilpv::bench {

/// The open-loop run: a plant and the torques that drive it.
class Replay {
 public:
  /// `torques`, one per sample, must outlive this. Throws InputError, PlantError.
  Replay(const Scenario& scenario, const std::vector<JointArray>& torques, double sample_period_s)
      : plant_(scenario.make_plant()),
        start_(plant_->initial_state(scenario.initial_angle, scenario.initial_speed)),
        torques_(torques),
        sample_period_s_(sample_period_s) {}

  const Plant& plant() const noexcept { return *plant_; }

  /// State at the end of every sample. Throws PlantError.
  std::vector<Eigen::VectorXd> run(Integrator& integrator) {
    std::vector<Eigen::VectorXd> states;
    states.reserve(torques_.size());
    Eigen::VectorXd y = start_;
    for (std::size_t k = 0; k < torques_.size(); ++k) {
      plant_->set_torque(torques_[k]);
      integrator.advance(static_cast<double>(k) * sample_period_s_, static_cast<double>(k + 1) * sample_period_s_, y);
      states.push_back(y);
    }
    return states;
  }

 private:
  std::unique_ptr<Plant> plant_;
  Eigen::VectorXd start_;
  const std::vector<JointArray>& torques_;
  double sample_period_s_;
};

/// Median CPU time per sample over the rounds, and the largest error of an actuated joint's angle.
inline nlohmann::json measure_integrator(const std::string& name, Replay& replay, Integrator& integrator, int rounds,
                                         const std::vector<Eigen::VectorXd>& exact) {
  std::vector<double> times;
  std::vector<Eigen::VectorXd> states = replay.run(integrator);
  for (int round = 0; round < rounds; ++round) {
    const std::int64_t start = clock_ns(CLOCK_THREAD_CPUTIME_ID);
    states = replay.run(integrator);
    const std::int64_t end = clock_ns(CLOCK_THREAD_CPUTIME_ID);
    times.push_back(static_cast<double>(end - start) / static_cast<double>(states.size()));
  }
  const int joints = replay.plant().joints();
  double error = 0.0;
  for (std::size_t k = 0; k < states.size(); ++k) {
    error = std::max(error, (states[k] - exact[k]).head(joints).cwiseAbs().maxCoeff());
  }
  return {{"integrator", name}, {"cpu_ns_per_sample", quantile(times, 0.5)}, {"largest_angle_error_rad", error}};
}

/// Measures IDA, with and without the plant's Jacobian, and RK4 with 1 and 4 steps a sample on the plant of `scenario`
/// under `torques`, against RK4 with steps so short that their truncation error is below rounding. The plant's state
/// must begin with the angles of its actuated joints. Throws InputError, PlantError.
inline nlohmann::json measure_integrators(const Scenario& scenario, const std::vector<JointArray>& torques,
                                          double sample_period_s, int rounds) {
  constexpr int kReferenceSteps = 100;
  Replay replay(scenario, torques, sample_period_s);
  Rk4Integrator reference(replay.plant(), sample_period_s / kReferenceSteps);
  const std::vector<Eigen::VectorXd> exact = replay.run(reference);

  const IdaOptions options;
  IdaIntegrator ida(replay.plant(), options);
  const DifferenceQuotientPlant difference_quotients(replay.plant());
  IdaIntegrator ida_without_jacobian(difference_quotients, options);
  Rk4Integrator rk4_1(replay.plant(), sample_period_s);
  Rk4Integrator rk4_4(replay.plant(), sample_period_s / 4.0);
  return {{"sample_period_s", sample_period_s},
          {"samples", torques.size()},
          {"relative_tolerance", options.relative_tolerance},
          {"reference_steps_per_sample", kReferenceSteps},
          {"integrators",
           {measure_integrator("IDA", replay, ida, rounds, exact),
            measure_integrator("IDA, difference quotients", replay, ida_without_jacobian, rounds, exact),
            measure_integrator("RK4, 1 step", replay, rk4_1, rounds, exact),
            measure_integrator("RK4, 4 steps", replay, rk4_4, rounds, exact)}}};
}

}  // namespace quasilpv::bench
