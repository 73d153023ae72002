// The loop of a general system: over a link it is the run in one process, and what goes wrong ends at the trim input.
#include "quasilpv/system_loop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "quasilpv/errors.hpp"
#include "quasilpv/in_process_link.hpp"
#include "quasilpv/link_robot.hpp"
#include "quasilpv/plant_loop.hpp"
#include "quasilpv/run_controller.hpp"
#include "quasilpv/system_simulation.hpp"
#include "system_fixture.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::refusal;
using ::quasilpv::testing::second_table;
using ::quasilpv::testing::system_table;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kPeriodNs = 10'000'000;
constexpr double kTrimInput = 0.5;

SystemArtifact pendulum() { return SystemArtifact::parse(json_twin(system_table()), "test"); }

WireIdentity identity_of(const SystemArtifact& artifact) {
  return {42, artifact.hash_prefix(), 0, Pace::kLockStep, kPeriodNs, {2, 0, 1, 1}};
}

Json scenario_table(std::int64_t samples) {
  return {{"schema", "quasilpv.system_scenario"},
          {"schema_version", 1},
          {"name", "test"},
          {"samples", samples},
          {"start", {{"x", 1.2}, {"v", 0.0}}},
          {"parameters", Json::object()},
          {"integrator", {{"kind", "ida"}, {"relative_tolerance", 1e-8}, {"absolute_tolerance", 1e-10}}},
          {"delay_s", 0.004},
          {"sensors", {{"noise", {{"x", 0.001}, {"v", 0.01}}}, {"quantum", {{"x", 0.0005}, {"v", 0.0}}}, {"seed", 7}}}};
}

SystemScenario scenario(const SystemArtifact& artifact, std::int64_t samples) {
  return SystemScenario::parse(scenario_table(samples).dump(), "scenario", artifact);
}

struct OverLink {
  PlantRunReport plant;
  ControllerRunReport controller;
  Record record;
  std::vector<SystemSample> telemetry;
  std::vector<event_v2> events;
};

/// Both ends on threads of their own.
OverLink run_over_link(const SystemArtifact& artifact, const SystemScenario& wanted, SystemLoop& loop) {
  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(artifact));
  auto ring = std::make_unique<SystemRing>();
  loop.publish_to(ring.get());
  LinkSystem port(*controller_end);
  const std::atomic<bool> stop{false};
  OverLink result;
  std::thread thread([&] { result.controller = run_controller(loop, port, {}, stop); });
  SystemSession session(artifact, wanted);
  result.plant = run_plant(session, *plant_end, {}, &result.record, stop);
  thread.join();
  SystemSample sample;
  while (ring->pop(sample)) {
    result.telemetry.push_back(sample);
  }
  loop.publish_to(nullptr);
  return result;
}

TEST(SystemLoop, gives_over_a_link_in_lock_step_the_samples_of_the_run_in_one_process_bit_for_bit) {
  constexpr std::int64_t kSamples = 300;
  const SystemArtifact artifact = pendulum();
  const SystemRun alone = simulate_system(artifact, scenario(artifact, kSamples));
  SystemLoop loop(artifact, {});
  const OverLink run = run_over_link(artifact, scenario(artifact, kSamples), loop);
  EXPECT_EQ(run.plant.end, PlantRunEnd::kCompleted);
  EXPECT_EQ(run.controller.end, ControllerRunEnd::kPlantEnded);
  ASSERT_EQ(run.telemetry.size(), static_cast<std::size_t>(kSamples));
  ASSERT_EQ(run.record["state.x"].values.size(), static_cast<std::size_t>(kSamples));
  for (std::size_t k = 0; k < run.telemetry.size(); ++k) {
    const SystemSample& sample = run.telemetry[k];
    ASSERT_EQ(sample.seq, static_cast<std::int64_t>(k));
    ASSERT_EQ(run.record["state.x"].values[k], alone.samples["state"].values[2 * k]);
    ASSERT_EQ(run.record["state.v"].values[k], alone.samples["state"].values[2 * k + 1]);
    ASSERT_EQ(run.record["input.u"].values[k], alone.samples["input"].values[k]);
    ASSERT_EQ(sample.measured[0], alone.samples["measured"].values[2 * k]);
    ASSERT_EQ(sample.measured[1], alone.samples["measured"].values[2 * k + 1]);
    ASSERT_EQ(sample.applied[0], alone.samples["input"].values[k]);
    ASSERT_EQ(sample.commanded[0], alone.samples["commanded"].values[k]);
    ASSERT_EQ(sample.premise[0], alone.samples["premise"].values[k]);
    ASSERT_EQ(sample.level, alone.samples["level"].values[k]);
  }
}

TEST(SystemLoop, when_a_state_leaves_its_domain_expect_the_same_last_sample_and_word_of_it) {
  const SystemArtifact artifact = pendulum();
  SystemScenario wanted = scenario(artifact, 100);
  wanted.start = {2.49, 9.0};
  const SystemRun alone = simulate_system(artifact, wanted);
  SystemLoop loop(artifact, {});
  const OverLink run = run_over_link(artifact, wanted, loop);
  ASSERT_TRUE(alone.exit.has_value());
  EXPECT_EQ(run.plant.end, PlantRunEnd::kCompleted);
  EXPECT_EQ(run.plant.samples, static_cast<std::int64_t>(alone.samples["time_s"].samples()));
  EXPECT_EQ(run.record["state.x"].values.back(), alone.samples["state"].values[2 * (run.telemetry.size() - 1)]);
  EXPECT_EQ(loop.state(), ControllerState::kDegraded);  // outside its region, which is no fault
}

TEST(SystemSession, says_on_the_wire_which_state_left_its_domain) {
  const SystemArtifact artifact = pendulum();
  SystemScenario wanted = scenario(artifact, 100);
  wanted.start = {2.6, 0.0};
  wanted.sensors = {};
  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(artifact));
  SystemSession session(artifact, wanted);
  const std::atomic<bool> stop{false};
  std::thread plant([&, end = plant_end.get()] { run_plant(session, *end, {}, nullptr, stop); });
  std::vector<event_v2> events;
  while (events.empty() || events.back().code != static_cast<int>(EventCode::kEnded)) {
    controller_end->receive(10'000'000);
    signals_measurement_v1 measurement;
    if (controller_end->take(measurement)) {
      EXPECT_EQ(measurement.value[0], 2.6);
      controller_end->send(to_message(SystemCommand{measurement.seq, {kTrimInput}, ControllerState::kRunning, 0}));
    }
    event_v2 event;
    while (controller_end->take(event)) {
      events.push_back(event);
    }
  }
  plant.join();
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[1].code, static_cast<int>(EventCode::kLeftDomain));
  EXPECT_EQ(events[1].seq, 0);
  EXPECT_EQ(events[1].detail[0], 0);
}

/// A plant that gets one command for its only sample.
PlantRunReport run_with(const SystemArtifact& artifact, double input) {
  auto [controller_end, plant_end] = InProcessLink::create_pair(identity_of(artifact));
  SystemSession session(artifact, scenario(artifact, 1));
  PlantRunSettings settings;
  settings.timeout_s = 0.05;
  const std::atomic<bool> stop{false};
  controller_end->send(to_message(SystemCommand{0, {input}, ControllerState::kRunning, 0}));
  return run_plant(session, *plant_end, settings, nullptr, stop);
}

TEST(SystemSession, refuses_inputs_that_are_not_finite_or_beyond_their_limits) {
  const SystemArtifact artifact = pendulum();
  for (const double wrong : {kNan, 6.5 + 1e-9, -5.5 - 1e-9, std::numeric_limits<double>::infinity()}) {
    const PlantRunReport refused = run_with(artifact, wrong);
    EXPECT_EQ(refused.end, PlantRunEnd::kCommandsRefused) << wrong;
    EXPECT_THAT(refused.refusal, HasSubstr("input u of sample 0"));
    EXPECT_EQ(refused.samples, 0);
  }
  for (const double right : {6.5, -5.5}) {
    EXPECT_EQ(run_with(artifact, right).end, PlantRunEnd::kCompleted);
  }
}

SystemReading reading(std::int64_t seq, double x = 1.1, double v = 0.2) {
  SystemReading measured;
  measured.seq = seq;
  measured.value[0] = x;
  measured.value[1] = v;
  return measured;
}

SampleConditions at(std::int64_t seq) {
  SampleConditions conditions;
  conditions.now_ns = seq * kPeriodNs;
  return conditions;
}

TEST(SystemLoop, when_measurements_are_not_numbers_expect_the_input_held_then_a_fault_and_the_trim) {
  SystemLoop loop(pendulum(), {});
  loop.handle(reading(0), at(0));
  EXPECT_EQ(loop.state(), ControllerState::kRunning);
  const double last = loop.command().input[0];
  ASSERT_GT(std::abs(last - kTrimInput), 0.5);
  for (std::int64_t k = 1; k < 20; ++k) {
    loop.handle(reading(k, kNan), at(k));
    ASSERT_EQ(loop.state(), ControllerState::kDegraded);
    ASSERT_EQ(loop.command().input[0], last);
    ASSERT_EQ(loop.command().flags, kSignalInvalid);
  }
  loop.handle(reading(20, 1.1, kNan), at(20));
  EXPECT_EQ(loop.state(), ControllerState::kFault);
  EXPECT_EQ(loop.cause(), FaultCause::kMeasurementLost);
  EXPECT_EQ(loop.predicted_steps(), 20);
  EXPECT_EQ(loop.post_mortem().size(), 21U);
  for (std::int64_t k = 20; k <= 24; ++k) {  // 40 ms at 100 Hz
    loop.handle(reading(k + 1), at(k + 1));
    const double share = std::min(1.0, static_cast<double>(k + 1 - 20) / 4.0);
    EXPECT_NEAR(loop.command().input[0], (1.0 - share) * last + share * kTrimInput, 1e-12);
  }
  EXPECT_TRUE(loop.is_safe(25 * kPeriodNs));
  EXPECT_EQ(loop.state(), ControllerState::kFault);  // latched, although measurements are back
  EXPECT_TRUE(loop.reset_fault());
  loop.handle(reading(26), at(26));
  EXPECT_EQ(loop.state(), ControllerState::kRunning);
  EXPECT_EQ(loop.command().input[0], last);
}

TEST(SystemLoop, counts_missing_samples_like_measurements_that_are_no_numbers) {
  SystemLoop loop(pendulum(), {});
  loop.handle(reading(0), at(0));
  loop.handle(reading(20), at(20));
  EXPECT_EQ(loop.state(), ControllerState::kRunning);
  EXPECT_EQ(loop.predicted_steps(), 19);
  loop.handle(reading(1000), at(1000));
  EXPECT_EQ(loop.cause(), FaultCause::kMeasurementLost);
  EXPECT_EQ(loop.predicted_steps(), 39);
  EXPECT_FALSE(loop.is_new(1000));
}

TEST(SystemLoop, when_premises_stay_outside_their_box_expect_degraded_then_a_fault) {
  SystemLoop loop(pendulum(), {});
  for (std::int64_t k = 0; k <= 100; ++k) {
    loop.handle(reading(k, 4.0), at(k));  // outside the region too
    ASSERT_EQ(loop.state(), ControllerState::kDegraded);
  }
  loop.handle(reading(101, 4.0), at(101));
  EXPECT_EQ(loop.state(), ControllerState::kFault);
  EXPECT_EQ(loop.cause(), FaultCause::kPremiseOutsideBox);
}

TEST(SystemLoop, when_the_artifact_states_a_policy_for_premises_outside_expect_the_loop_to_keep_it) {
  const auto loop_with = [](const Json& policy) {
    Json table = second_table();
    table["law"]["premise_fault_s"] = policy;
    return SystemLoop(SystemArtifact::parse(json_twin(table), "test"), {});
  };
  SystemLoop at_once = loop_with(0);
  at_once.handle(reading(0, 1.1), at(0));
  EXPECT_EQ(at_once.state(), ControllerState::kRunning);
  at_once.handle(reading(1, 4.0), at(1));
  EXPECT_EQ(at_once.cause(), FaultCause::kPremiseOutsideBox);
  EXPECT_FALSE(at_once.reset_fault());  // it is still outside
  at_once.handle(reading(2, 1.1), at(2));
  EXPECT_TRUE(at_once.reset_fault());
  SystemLoop after = loop_with(0.1);
  SystemLoop never = loop_with(nullptr);
  for (std::int64_t k = 0; k <= 10; ++k) {
    after.handle(reading(k, 4.0), at(k));
    ASSERT_EQ(after.state(), ControllerState::kDegraded);
  }
  after.handle(reading(11, 4.0), at(11));
  EXPECT_EQ(after.cause(), FaultCause::kPremiseOutsideBox);
  for (std::int64_t k = 0; k <= 1000; ++k) {
    never.handle(reading(k, 4.0), at(k));
    ASSERT_EQ(never.state(), ControllerState::kDegraded);
  }
}

TEST(SystemLoop, when_the_plant_falls_silent_or_somebody_asks_expect_the_fault_of_that_cause) {
  SystemLoop silent(pendulum(), {});
  silent.handle(reading(0), at(0));
  silent.handle_silence(at(1));
  EXPECT_EQ(silent.cause(), FaultCause::kPlantSilent);
  EXPECT_EQ(silent.command().seq, 1);
  SystemLoop stopped(pendulum(), {});
  SampleConditions conditions = at(0);
  conditions.stop_requested = true;
  stopped.handle(reading(0), conditions);
  EXPECT_EQ(stopped.cause(), FaultCause::kStopRequested);
  EXPECT_EQ(stopped.command().input[0], kTrimInput);
}

struct Damage {
  const char* field;
  std::function<void(Json&)> change;
};

TEST(SystemScenario, refuses_what_does_not_fit_the_artifact_and_names_it) {
  const SystemArtifact artifact = pendulum();
  const std::vector<Damage> damages = {
      {"samples", [](Json& table) { table["samples"] = 0; }},
      {"start.v", [](Json& table) { table["start"].erase("v"); }},
      {"start: got the unknown member \"y\"", [](Json& table) { table["start"]["y"] = 1.0; }},
      {"parameters: got the unknown member \"m\", expected no members",
       [](Json& table) { table["parameters"]["m"] = 1.0; }},
      {"delay_s", [](Json& table) { table["delay_s"] = 0.011; }},
      {"sensors.noise.x", [](Json& table) { table["sensors"]["noise"]["x"] = -1.0; }},
      {"sensors.quantum.v", [](Json& table) { table["sensors"]["quantum"].erase("v"); }},
      {"sensors.seed", [](Json& table) { table["sensors"]["seed"] = -1; }},
      {"integrator.kind", [](Json& table) { table["integrator"]["kind"] = "euler"; }},
      {"schema", [](Json& table) { table["schema"] = "quasilpv.scenario"; }},
  };
  for (const Damage& damage : damages) {
    Json table = scenario_table(10);
    damage.change(table);
    EXPECT_THAT(refusal([&] { SystemScenario::parse(table.dump(), "scenario", artifact); }), HasSubstr(damage.field));
  }
}

TEST(SystemSession, measures_multiples_of_the_quantum_near_the_truth_and_repeats_what_it_measured) {
  const SystemArtifact artifact = pendulum();
  constexpr std::int64_t kSamples = 400;
  SystemSession session(artifact, scenario(artifact, kSamples));
  SystemSession twin(artifact, scenario(artifact, kSamples));
  SystemController controller(artifact);
  double sum = 0.0;
  while (session.seq() < session.samples()) {
    const double x = session.measured()[0];
    EXPECT_NEAR(x / 0.0005, std::round(x / 0.0005), 1e-9);
    EXPECT_LT(std::abs(x - session.truth()[0]), 0.006);
    const double error = session.measured()[1] - session.truth()[1];
    sum += error * error;
    EXPECT_EQ(twin.measured(), session.measured());
    const SystemReport report = controller.step(session.measured().data(), nullptr);
    session.advance(report.input);
    twin.advance(report.input);
  }
  EXPECT_EQ(session.seq(), kSamples);
  EXPECT_NEAR(std::sqrt(sum / kSamples), 0.01, 0.002);  // 5.6 of its own standard deviations
}

}  // namespace
}  // namespace quasilpv
