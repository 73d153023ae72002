// inverse_dynamics_bench SCENARIO STATES ROUNDS: inverse dynamics of the scenario's planar arm in the closed form of
// SerialArm, or of its robot in space by the recursion of TreeDynamics; pinocchio/rnea.cpp is its competitor.
#include <string>
#include <variant>
#include <vector>

#include "arm_states.hpp"
#include "main.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/serial_arm.hpp"
#include "quasilpv/tree_plant.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

template <class Torque>
nlohmann::json timed(const std::vector<std::string>& arguments, const Torque& torque) {
  const std::vector<ArmState> states = read_states(arguments[1]);
  const Timing timing = time_calls(
      states.size(), count(arguments[2]), [] {}, [&](std::size_t i) { keep(torque(states[i])); });
  return {{"timing", to_json(timing)}, {"torques_nm", torques_at(states, torque)}};
}

nlohmann::json measure(const std::vector<std::string>& arguments) {
  const auto plant = Scenario::load(arguments[0]).make_plant();
  if (const auto* tree = dynamic_cast<const TreePlant*>(plant.get())) {
    return timed(arguments, [&](const ArmState& state) {
      TreeVector torque(tree->joints());
      tree->dynamics().inverse_dynamics(state.angle.data(), state.speed.data(), state.acceleration.data(),
                                        torque.data());
      return torque;
    });
  }
  const auto& arm = dynamic_cast<const SerialArm&>(*plant);
  return timed(arguments, [&](const ArmState& state) {
    return arm.inverse_dynamics(state.angle, state.speed, state.acceleration);
  });
}

}  // namespace

int main(int argc, char** argv) { return run_benchmark(argc, argv, {"SCENARIO", "STATES", "ROUNDS"}, measure); }
