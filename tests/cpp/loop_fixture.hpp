// One small experiment for the tests of both loops: law, reference, plant, messages.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "arm_fixtures.hpp"
#include "artifact_fixture.hpp"
#include "quasilpv/loop.hpp"
#include "quasilpv/messages.hpp"
#include "quasilpv/realtime.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/simulation.hpp"
#include "quasilpv/trajectory.hpp"

namespace quasilpv::testing {

inline constexpr int kJoints = 3;
inline constexpr std::int64_t kMillisecond = kNanosecondsPerMillisecond;
inline constexpr std::int64_t kPatience = 5 * kNanosecondsPerSecond;
inline const JointArray kStart{0.3, -0.2, 0.4};

/// Minimum-jerk motion of all joints by 0.2 rad in 1 s, from kStart.
inline Trajectory trajectory() {
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

/// With a Lyapunov bound for the monitor, where the kind has one. The domain holds the speeds to which the disturbances
/// of these runs drive the light arm.
inline Artifact artifact(const std::string& kind = "dob-acceleration", double fastest_rad_s = 50.0) {
  Json table = artifact_table(kind, kJoints);
  table["domain"]["speed_rad_s"] = std::vector<Json>(kJoints, Json::array({-fastest_rad_s, fastest_rad_s}));
  if (kind == "dob-acceleration") {
    table["law"]["lyapunov_bound"] = TestArm{kJoints}.lyapunov_bound();
  }
  return Artifact::parse(json_twin(table), "test");
}

/// Every imperfection on: a difference in the order of calls or in the number of noise samples shows.
inline Scenario scenario(std::int64_t samples) {
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

/// The run that every other way of running `experiment` must repeat bit for bit.
inline RunRecord run_in_process(const Artifact& law, const Scenario& experiment) {
  Controller controller(law);
  return run_closed_loop(experiment, controller, trajectory());
}

inline WireIdentity identity_of(const Artifact& artifact) { return {11, artifact.hash_prefix(), artifact.joints()}; }

inline measurement_v3 measurement(std::int64_t seq, const JointArray& angle = kStart) {
  measurement_v3 message{};
  message.seq = seq;
  std::copy(angle.begin(), angle.end(), message.angle_rad);
  return message;
}

inline RobotReading reading(std::int64_t seq, const JointArray& angle = kStart) {
  RobotReading result;
  result.seq = seq;
  result.angle_rad = angle;
  return result;
}

inline SampleConditions at(std::int64_t seq) {
  SampleConditions conditions;
  conditions.now_ns = seq * kMillisecond;
  return conditions;
}

}  // namespace quasilpv::testing
