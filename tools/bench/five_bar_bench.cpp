// five_bar_bench SCENARIO ROUNDS: CPU time and error of the integrators on a five-bar. PD control swings its
// joints about the initial angles at 1 kHz; the torques are recorded and then held over each sample, so that all
// integrators solve the same problem.
#include <cmath>
#include <string>

#include "main.hpp"
#include "quasilpv/simulation.hpp"
#include "replay.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

constexpr double kSamplePeriod = 1e-3;
constexpr double kStiffness = 60.0;  // N m
constexpr double kDamping = 0.8;     // N m s

/// Sines of 0.25 rad at 4 and 6 rad/s, so that direction and opening of the legs both change.
Reference swing(const JointArray& centre, double time_s) {
  Reference reference;
  for (std::size_t j = 0; j < 2; ++j) {
    const double frequency = j == 0 ? 4.0 : 6.0;
    reference.angle[j] = centre[j] + 0.25 * std::sin(frequency * time_s);
    reference.speed[j] = 0.25 * frequency * std::cos(frequency * time_s);
  }
  return reference;
}

nlohmann::json measure(const std::vector<std::string>& arguments) {
  const Scenario scenario = Scenario::load(arguments[0]);
  std::vector<JointArray> torques;
  run_closed_loop(
      scenario, kSamplePeriod,
      [&](const StepInput& input) {
        StepReport report{};
        for (std::size_t j = 0; j < static_cast<std::size_t>(scenario.joints()); ++j) {
          report.torque_applied[j] = kStiffness * (input.reference.angle[j] - input.angle[j]) +
                                     kDamping * (input.reference.speed[j] - input.speed[j]);
        }
        torques.push_back(report.torque_applied);
        return report;
      },
      [&](double time_s) { return swing(scenario.initial_angle, time_s); });
  return measure_integrators(scenario, torques, kSamplePeriod, count(arguments[1]));
}

}  // namespace

int main(int argc, char** argv) { return run_benchmark(argc, argv, {"SCENARIO", "ROUNDS"}, measure); }
