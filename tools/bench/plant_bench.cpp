// plant_bench ARTIFACT TRAJECTORY SCENARIO ROUNDS: CPU time and error of the integrators over a whole run. The torques
// of the closed loop are recorded first and then held over each sample, so that all integrators solve the same problem.
#include <string>

#include "experiment.hpp"
#include "main.hpp"
#include "replay.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

nlohmann::json measure(const std::vector<std::string>& arguments) {
  const Artifact artifact = Artifact::load(arguments[0]);
  const Scenario scenario = Scenario::load(arguments[2]);
  const Recording recording = record(artifact, Trajectory::load(arguments[1]), scenario);
  return measure_integrators(scenario, recording.torques, artifact.sample_period_s(), count(arguments[3]));
}

}  // namespace

int main(int argc, char** argv) {
  return run_benchmark(argc, argv, {"ARTIFACT", "TRAJECTORY", "SCENARIO", "ROUNDS"}, measure);
}
