// inverse_dynamics_bench SCENARIO STATES ROUNDS: inverse dynamics of the scenario's planar arm in the closed form of
// SerialArm; pinocchio/rnea.cpp is its competitor.
#include <string>
#include <variant>
#include <vector>

#include "arm_states.hpp"
#include "main.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/serial_arm.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

nlohmann::json measure(const std::vector<std::string>& arguments) {
  const auto plant = Scenario::load(arguments[0]).make_plant();
  const auto& arm = dynamic_cast<const SerialArm&>(*plant);
  const std::vector<ArmState> states = read_states(arguments[1]);
  const auto torque = [&](const ArmState& state) {
    return arm.inverse_dynamics(state.angle, state.speed, state.acceleration);
  };
  const Timing timing = time_calls(
      states.size(), count(arguments[2]), [] {}, [&](std::size_t i) { keep(torque(states[i])); });
  return {{"timing", to_json(timing)}, {"torques_nm", torques_at(states, torque)}};
}

}  // namespace

int main(int argc, char** argv) { return run_benchmark(argc, argv, {"SCENARIO", "STATES", "ROUNDS"}, measure); }
