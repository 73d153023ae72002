// The loop over wires that lose, repeat, reorder and delay packets: ten simulated minutes of it.
#include "quasilpv/lossy_robot.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <fstream>

#include "loop_fixture.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/run_controller.hpp"

namespace quasilpv {
namespace {

using namespace quasilpv::testing;  // NOLINT(google-build-using-namespace): fixtures

// Sanitizers keep freed memory and are slow: there a minute shows what they are for.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif
constexpr int kSeconds = kSanitized ? 60 : 600;

/// 5 % loss, 1 % duplicates, 1 % reordered and half a sample of jitter, each way.
WireFaults bad_wire() { return {0.05, 0.01, 0.01, 0.5, 3}; }

/// To and fro by 0.2 rad, one second each way.
Trajectory to_and_fro(int seconds) {
  Json knots = {0.0};
  Json segments = Json::array();
  for (int second = 0; second < seconds; ++second) {
    const double way = second % 2 == 0 ? 1.0 : -1.0;
    Json segment = Json::array();
    for (int j = 0; j < kJoints; ++j) {
      const double from = kStart[static_cast<std::size_t>(j)] + (second % 2 == 0 ? 0.0 : 0.2);
      segment.push_back({from, 0.0, 0.0, way * 2.0, way * -3.0, way * 1.2});
    }
    knots.push_back(second + 1.0);
    segments.push_back(segment);
  }
  const Json table = {{"schema", "quasilpv.trajectory"},
                      {"schema_version", 1},
                      {"name", "to-and-fro"},
                      {"joints", kJoints},
                      {"task", nullptr},
                      {"knots_s", knots},
                      {"coefficients", segments}};
  return Trajectory::parse(json_twin(table), "test");
}

Scenario disturbed(int seconds) {
  Scenario result = scenario(std::int64_t{1000} * seconds);
  result.integrator = Rk4Options{};
  result.transport_delay_s = 0.0;
  return result;
}

std::int64_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t total = 0;
  std::int64_t resident = 0;
  file >> total >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

/// One run over a wire, and what came of it.
struct LossyRun {
  LossyRun(const WireFaults& faults, int seconds)
      : reference(to_and_fro(seconds)),
        loop(artifact(), reference, LoopSettings{}),
        session(disturbed(seconds), kSamplePeriod),
        robot(session, identity_of(artifact()), faults, [this](const PlantSession& plant) { observe(plant); }) {
    const std::atomic<bool> stop{false};
    report = run_controller(loop, robot, ControllerRunSettings{}, stop);
  }

  void observe(const PlantSession& plant) {
    const double time_s = static_cast<double>(plant.seq()) * kSamplePeriod;
    const Reference wanted = reference.evaluate(time_s);
    for (std::size_t j = 0; j < kJoints; ++j) {
      squares += std::pow(plant.truth().angle[j] - wanted.angle[j], 2);
    }
    if (plant.seq() == plant.samples() / 10) {
      resident_early = resident_bytes();
    }
  }

  double rms() const { return std::sqrt(squares / static_cast<double>(session.samples() * kJoints)); }

  Trajectory reference;
  ControlLoop loop;
  PlantSession session;
  double squares = 0.0;
  std::int64_t resident_early = 0;
  LossyRobot robot;
  ControllerRunReport report;
};

void expect_every_packet_counted_once(const WireCounters& wire, const LinkCounters& link) {
  EXPECT_EQ(wire.sent - wire.lost + wire.duplicated, wire.delivered + wire.in_flight);
  EXPECT_EQ(link.accepted + link.duplicates + link.old, wire.delivered);
  EXPECT_EQ(link.wrong_checksum + link.wrong_session + link.send_failures + link.superseded, 0);
}

TEST(LossyRobot, when_ten_minutes_are_lossy_expect_no_fault_and_at_most_one_and_a_half_times_the_clean_error) {
  const LossyRun clean({}, kSeconds);
  const LossyRun lossy(bad_wire(), kSeconds);
  const std::int64_t samples = lossy.session.samples();
  ASSERT_EQ(samples, std::int64_t{1000} * kSeconds);

  EXPECT_EQ(lossy.report.end, ControllerRunEnd::kPlantEnded);
  EXPECT_EQ(lossy.loop.state(), ControllerState::kRunning);
  EXPECT_EQ(lossy.loop.faults(), 0);
  EXPECT_GT(clean.rms(), 0.0);
  EXPECT_LE(lossy.rms(), 1.5 * clean.rms()) << "clean " << clean.rms() << " rad";
  ::testing::Test::RecordProperty("rms_ratio", std::to_string(lossy.rms() / clean.rms()));

  const WireCounters sent = lossy.robot.measurement_wire();
  const WireCounters answered = lossy.robot.command_wire();
  expect_every_packet_counted_once(sent, lossy.robot.measurements());
  expect_every_packet_counted_once(answered, lossy.robot.commands());
  EXPECT_EQ(sent.sent, samples);
  EXPECT_EQ(answered.sent, lossy.report.commands);
  EXPECT_EQ(lossy.report.commands, lossy.robot.measurements().accepted + lossy.report.repeated);
  EXPECT_EQ(lossy.loop.steps(), lossy.loop.last_seq() + 1);
  EXPECT_EQ(lossy.loop.predicted_steps(), lossy.loop.steps() - lossy.robot.measurements().accepted);

  // It did happen: each within five standard deviations of what was asked for.
  const auto expect_share = [&](std::int64_t count, std::int64_t of, double share) {
    const auto n = static_cast<double>(of);
    EXPECT_NEAR(static_cast<double>(count), share * n, 5.0 * std::sqrt(share * n));
  };
  for (const WireCounters& wire : {sent, answered}) {
    expect_share(wire.lost, wire.sent, 0.05);
    expect_share(wire.duplicated, wire.sent - wire.lost, 0.01);
    expect_share(wire.reordered, wire.sent - wire.lost, 0.01);
  }
  if (!kSanitized) {
    EXPECT_LT(resident_bytes() - lossy.resident_early, 1 << 20);
  }
}

TEST(LossyRobot, when_the_wire_is_perfect_expect_the_run_of_the_plant_without_one) {
  const LossyRun wired({}, 1);
  PlantSession session(disturbed(1), kSamplePeriod);
  const Trajectory reference = to_and_fro(1);
  Controller controller(artifact());
  for (std::int64_t k = 0; k < session.samples(); ++k) {
    StepInput input;
    input.seq = k;
    input.angle = session.measure(k).angle;
    input.speed = session.measure(k).speed;
    input.reference = reference.evaluate(static_cast<double>(k) * kSamplePeriod);
    session.advance(k, controller.step(input).torque_applied);
  }
  EXPECT_EQ(wired.session.truth().angle, session.truth().angle);
  EXPECT_EQ(wired.session.truth().speed, session.truth().speed);
}

TEST(LossyRobot, when_equal_seeds_are_given_expect_equal_runs_and_other_ones_with_another_seed) {
  WireFaults other = bad_wire();
  other.random_seed = 4;
  const LossyRun first(bad_wire(), 2);
  const LossyRun again(bad_wire(), 2);
  const LossyRun different(other, 2);
  EXPECT_EQ(first.squares, again.squares);
  EXPECT_NE(first.squares, different.squares);
}

TEST(LossyRobot, when_only_one_thing_goes_wrong_expect_only_its_counter_and_exactly) {
  const LossyRun losing({0.05, 0.0, 0.0, 0.0, 5}, 5);
  EXPECT_EQ(losing.robot.measurements().accepted, losing.session.samples() - losing.robot.measurement_wire().lost);
  EXPECT_EQ(losing.robot.measurements().duplicates + losing.robot.measurements().old, 0);

  const LossyRun repeating({0.0, 0.05, 0.0, 0.0, 5}, 5);
  EXPECT_EQ(repeating.robot.measurements().duplicates, repeating.robot.measurement_wire().duplicated);
  EXPECT_EQ(repeating.robot.measurements().old, 0);
  EXPECT_EQ(repeating.loop.predicted_steps(), 0);

  // Overtaken by its successor, unless that one is as late.
  const LossyRun reordering({0.0, 0.0, 0.05, 0.0, 5}, 5);
  const std::int64_t late = reordering.robot.measurement_wire().reordered;
  EXPECT_GT(late, 0);
  EXPECT_LE(reordering.robot.measurements().old, late);
  EXPECT_GE(static_cast<double>(reordering.robot.measurements().old), 0.8 * static_cast<double>(late));
  EXPECT_EQ(reordering.loop.predicted_steps(), reordering.robot.measurements().old);
}

TEST(LossyRobot, when_everything_is_lost_expect_the_run_to_end_with_nothing_answered) {
  const LossyRun run({1.0, 0.0, 0.0, 0.0, 1}, 1);
  EXPECT_EQ(run.report.commands, 0);
  EXPECT_EQ(run.loop.steps(), 0);
  EXPECT_EQ(run.session.seq(), run.session.samples());
}

TEST(LossyRobot, when_a_probability_is_none_expect_refusal) {
  PlantSession session(disturbed(1), kSamplePeriod);
  for (const WireFaults& faults :
       {WireFaults{1.1}, WireFaults{0.0, -0.1}, WireFaults{0.0, 0.0, NAN}, WireFaults{0.0, 0.0, 0.0, 0.6}}) {
    EXPECT_THROW(LossyRobot(session, identity_of(artifact()), faults), InputError);
  }
}

}  // namespace
}  // namespace quasilpv
