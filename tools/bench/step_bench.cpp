// step_bench ARTIFACT TRAJECTORY SCENARIO ROUNDS: duration of the control step, warm, over the samples of a whole
// closed-loop run, which are recorded first and replayed without the plant.
#include <stdexcept>
#include <string>
#include <vector>

#include "experiment.hpp"
#include "main.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

nlohmann::json measure(const std::vector<std::string>& arguments) {
  const Artifact artifact = Artifact::load(arguments[0]);
  const Trajectory trajectory = Trajectory::load(arguments[1]);
  const Recording recording = record(artifact, trajectory, Scenario::load(arguments[2]));

  Controller controller(artifact);
  const Timing timing = time_calls(
      recording.inputs.size(), count(arguments[3]), [&] { controller.reset(); },
      [&](std::size_t i) { keep(controller.step(recording.inputs[i])); });

  // A replay that is not the recorded run would time something else.
  controller.reset();
  for (std::size_t i = 0; i < recording.inputs.size(); ++i) {
    if (controller.step(recording.inputs[i]).torque_applied != recording.torques[i]) {
      throw std::runtime_error(artifact.name() + ": the replayed torque differs at sample " + std::to_string(i));
    }
  }
  return {{"law", artifact.law_kind()}, {"flags", recording.flags}, {"timing", to_json(timing)}};
}

}  // namespace

int main(int argc, char** argv) {
  return run_benchmark(argc, argv, {"ARTIFACT", "TRAJECTORY", "SCENARIO", "ROUNDS"}, measure);
}
