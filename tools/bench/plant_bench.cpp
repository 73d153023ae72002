// plant_bench ARTIFACT TRAJECTORY SCENARIO ROUNDS: CPU time and error of the integrators over a whole run. The torques
// of the closed loop are recorded first and then held over each sample, so that all integrators solve the same problem.
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "difference_quotient_plant.hpp"
#include "experiment.hpp"
#include "main.hpp"
#include "quasilpv/ida_integrator.hpp"
#include "quasilpv/rk4_integrator.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

// The reference: steps of a hundredth of a sample, whose truncation error is below rounding.
constexpr int kReferenceSteps = 100;

/// The open-loop run: a plant and the torques that drive it.
class Replay {
 public:
  Replay(const Scenario& scenario, const std::vector<JointArray>& torques, double sample_period_s)
      : plant_(scenario.make_plant()),
        start_(plant_->initial_state(scenario.initial_angle, scenario.initial_speed)),
        torques_(torques),
        sample_period_s_(sample_period_s) {}

  const Plant& plant() const noexcept { return *plant_; }

  /// State at the end of every sample.
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

/// Median CPU time per sample over the rounds, and the largest angle error.
Json measure_integrator(const std::string& name, Replay& replay, Integrator& integrator, int rounds,
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

Json measure(const std::vector<std::string>& arguments) {
  const Artifact artifact = Artifact::load(arguments[0]);
  const Scenario scenario = Scenario::load(arguments[2]);
  const Recording recording = record(artifact, Trajectory::load(arguments[1]), scenario);
  const double period = artifact.sample_period_s();
  const int rounds = std::stoi(arguments[3]);

  Replay replay(scenario, recording.torques, period);
  Rk4Integrator reference(replay.plant(), period / kReferenceSteps);
  const std::vector<Eigen::VectorXd> exact = replay.run(reference);

  const IdaOptions options;
  IdaIntegrator ida(replay.plant(), options);
  const DifferenceQuotientPlant difference_quotients(replay.plant());
  IdaIntegrator ida_without_jacobian(difference_quotients, options);
  Rk4Integrator rk4_1(replay.plant(), period);
  Rk4Integrator rk4_4(replay.plant(), period / 4.0);
  return {{"sample_period_s", period},
          {"samples", recording.torques.size()},
          {"flags", recording.flags},
          {"relative_tolerance", options.relative_tolerance},
          {"reference_steps_per_sample", kReferenceSteps},
          {"integrators",
           {measure_integrator("IDA", replay, ida, rounds, exact),
            measure_integrator("IDA, difference quotients", replay, ida_without_jacobian, rounds, exact),
            measure_integrator("RK4, 1 step", replay, rk4_1, rounds, exact),
            measure_integrator("RK4, 4 steps", replay, rk4_4, rounds, exact)}}};
}

}  // namespace

int main(int argc, char** argv) {
  return run_benchmark(argc, argv, {"ARTIFACT", "TRAJECTORY", "SCENARIO", "ROUNDS"}, measure);
}
