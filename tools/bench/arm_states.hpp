// Joint motions at which inverse dynamics is evaluated, the same for every implementation that is compared.
#pragma once

#include <Eigen/Core>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace quasilpv::bench {

/// One motion: angle (rad), speed (rad/s), acceleration (rad/s^2), all of shape [n].
struct ArmState {
  Eigen::VectorXd angle;
  Eigen::VectorXd speed;
  Eigen::VectorXd acceleration;
};

/// Reads a JSON file. Throws std::runtime_error naming it if it cannot be opened, nlohmann::json::exception if it is
/// not JSON.
inline nlohmann::json read_json(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    throw std::runtime_error(path + ": cannot be opened");
  }
  return nlohmann::json::parse(file);
}

inline Eigen::VectorXd to_vector(const nlohmann::json& numbers) {
  const auto values = numbers.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// Reads `[{"angle": [n], "speed": [n], "acceleration": [n]}, ...]`. Errors as read_json().
inline std::vector<ArmState> read_states(const std::string& path) {
  std::vector<ArmState> states;
  for (const nlohmann::json& state : read_json(path)) {
    states.push_back({to_vector(state.at("angle")), to_vector(state.at("speed")), to_vector(state.at("acceleration"))});
  }
  return states;
}

/// Evaluates `torque(state)` at all states for the comparison of implementations: rows of numbers, N m.
template <class Torque>
nlohmann::json torques_at(const std::vector<ArmState>& states, const Torque& torque) {
  nlohmann::json rows = nlohmann::json::array();
  for (const ArmState& state : states) {
    const Eigen::VectorXd value = torque(state);
    rows.push_back(std::vector<double>(value.data(), value.data() + value.size()));
  }
  return rows;
}

}  // namespace quasilpv::bench
