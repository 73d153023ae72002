#include "loop_fixture.hpp"

#include <algorithm>

#include "arm_fixtures.hpp"

namespace quasilpv::testing {

Trajectory trajectory() {
  Json segment = Json::array();
  for (int j = 0; j < kJoints; ++j) {
    segment.push_back({kStart[static_cast<std::size_t>(j)], 0.0, 0.0, 2.0, -3.0, 1.2});
  }
  const Json table = {{"schema", "quasilpv.trajectory"},
                      {"schema_version", 1},
                      {"name", "minimum-jerk"},
                      {"joints", kJoints},
                      {"task", nullptr},
                      {"knots_s", {0.0, 1.0}},
                      {"coefficients", Json::array({segment})}};
  return Trajectory::parse(json_twin(table), "test");
}

Artifact artifact(const std::string& kind, double fastest_rad_s) {
  Json table = artifact_table(kind, kJoints);
  table["domain"]["speed_rad_s"] = std::vector<Json>(kJoints, Json::array({-fastest_rad_s, fastest_rad_s}));
  if (kind == "dob-acceleration") {
    table["law"]["lyapunov_bound"] = TestArm{kJoints}.lyapunov_bound();
  }
  return Artifact::parse(json_twin(table), "test");
}

Scenario scenario(std::int64_t samples) {
  Scenario scenario;
  scenario.name = "test";
  scenario.duration_s = static_cast<double>(samples) * kSamplePeriod;
  scenario.plant = [] { return std::make_unique<SerialArm>(three_link_arm(0.5)); };
  scenario.external_torque = {{1, 20.0, 15.0, 0.3}};
  scenario.sensors = {20, 0.05, 7};
  scenario.transport_delay_s = 0.3 * kSamplePeriod;
  scenario.initial_angle = kStart;
  return scenario;
}

RunRecord run_in_process(const Artifact& law, const Scenario& experiment) {
  Controller controller(law);
  return run_closed_loop(experiment, controller, trajectory());
}

WireIdentity identity_of(const Artifact& artifact) { return {11, artifact.hash_prefix(), artifact.joints()}; }

measurement_v3 measurement(std::int64_t seq, const JointArray& angle) {
  measurement_v3 message{};
  message.seq = seq;
  std::copy(angle.begin(), angle.end(), message.angle_rad);
  return message;
}

RobotReading reading(std::int64_t seq, const JointArray& angle) {
  RobotReading result;
  result.seq = seq;
  result.angle_rad = angle;
  return result;
}

SampleConditions at(std::int64_t seq) {
  SampleConditions conditions;
  conditions.now_ns = seq * kMillisecond;
  return conditions;
}

}  // namespace quasilpv::testing
