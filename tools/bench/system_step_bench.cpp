// system_step_bench ARTIFACT ROUNDS: duration of the control step of a general system, warm, over states in its region.
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "main.hpp"
#include "quasilpv/system_controller.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

constexpr std::size_t kStates = 4096;

nlohmann::json measure(const std::vector<std::string>& arguments) {
  const SystemArtifact artifact = SystemArtifact::load(arguments[0]);
  SystemController controller(artifact);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const std::size_t n = artifact.states().size();
  std::vector<double> states(kStates * n);
  std::vector<double> parameters;
  for (const SystemSignal& parameter : artifact.parameters()) {
    parameters.push_back(0.5 * (parameter.low + parameter.high) + parameter.trim);
  }
  for (std::size_t k = 0; k < states.size(); ++k) {
    const SystemSignal& state = artifact.states()[k % n];
    const double reach = std::isfinite(state.high) ? std::min(state.high, -state.low) : 1.0;
    states[k] = state.trim + 0.3 * reach * unit(random);
  }
  const Timing timing = time_calls(
      kStates, count(arguments[1]), [&] { controller.reset(); },
      [&](std::size_t i) { keep(controller.step(&states[i * n], parameters.data())); });
  return {{"name", artifact.name()}, {"states", n}, {"timing", to_json(timing)}};
}

}  // namespace

int main(int argc, char** argv) { return run_benchmark(argc, argv, {"ARTIFACT", "ROUNDS"}, measure); }
