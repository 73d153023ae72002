#include "quasilpv/trajectory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "artifact_fixture.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::refusal;
using ::testing::HasSubstr;

// Two joints. Joint 0: the minimum-jerk move from 0.5 to 1.5 in 2 s, cut at t = 0.75. Joint 1: rest at -0.25.
// Minimum jerk: r = 0.5 + 10 s^3 - 15 s^4 + 6 s^5 with s = t / 2 (Flash and Hogan 1985).
constexpr double kCut = 0.75;
constexpr double kEnd = 2.0;

double minimum_jerk(double t) {
  const double s = t / kEnd;
  return 0.5 + s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
}

double minimum_jerk_speed(double t) {
  const double s = t / kEnd;
  return 30.0 * s * s * (1.0 - s) * (1.0 - s) / kEnd;
}

double minimum_jerk_acceleration(double t) {
  const double s = t / kEnd;
  return 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (kEnd * kEnd);
}

// Coefficients of r(start + tau) in powers of tau, by the binomial theorem.
std::vector<double> shifted_coefficients(double start) {
  const std::vector<double> c = {0.5, 0.0, 0.0, 10.0 / 8.0, -15.0 / 16.0, 6.0 / 32.0};
  std::vector<double> shifted(6, 0.0);
  for (std::size_t power = 0; power < 6; ++power) {
    double binomial = 1.0;
    for (std::size_t k = 0; k <= power; ++k) {
      shifted[k] += c[power] * binomial * std::pow(start, static_cast<double>(power - k));
      binomial = binomial * static_cast<double>(power - k) / static_cast<double>(k + 1);
    }
  }
  return shifted;
}

Json trajectory_table() {
  const std::vector<double> rest = {-0.25, 0.0, 0.0, 0.0, 0.0, 0.0};
  return {{"schema", "quasilpv.trajectory"},
          {"schema_version", 1},
          {"name", "minimum-jerk"},
          {"joints", 2},
          {"task", nullptr},
          {"knots_s", {0.0, kCut, kEnd}},
          {"coefficients", {{shifted_coefficients(0.0), rest}, {shifted_coefficients(kCut), rest}}}};
}

Trajectory parse(const Json& table) { return Trajectory::parse(json_twin(table), "t.json"); }

TEST(Trajectory, follows_the_polynomials_across_the_knots) {
  const Trajectory trajectory = parse(trajectory_table());
  EXPECT_EQ(trajectory.joints(), 2);
  EXPECT_EQ(trajectory.duration_s(), kEnd);
  EXPECT_EQ(trajectory.name(), "minimum-jerk");
  for (double t = 0.0; t <= kEnd; t += 1.0 / 1024.0) {
    const Reference reference = trajectory.evaluate(t);
    EXPECT_NEAR(reference.angle[0], minimum_jerk(t), 1e-14);
    EXPECT_NEAR(reference.speed[0], minimum_jerk_speed(t), 1e-14);
    EXPECT_NEAR(reference.acceleration[0], minimum_jerk_acceleration(t), 1e-13);
    EXPECT_EQ(reference.angle[1], -0.25);
    EXPECT_EQ(reference.speed[1], 0.0);
    EXPECT_EQ(reference.angle[2], 0.0);
  }
}

TEST(Trajectory, holds_its_first_and_last_angles_at_rest) {
  Json moving = trajectory_table();
  moving["knots_s"] = {0.0, kCut};  // ends in the middle of the move
  moving["coefficients"].erase(1);
  const Trajectory trajectory = parse(moving);
  for (const double t : {kCut + 1e-9, 10.0, std::numeric_limits<double>::infinity()}) {
    const Reference reference = trajectory.evaluate(t);
    EXPECT_NEAR(reference.angle[0], minimum_jerk(kCut), 1e-14);
    EXPECT_EQ(reference.speed[0], 0.0);
    EXPECT_EQ(reference.acceleration[0], 0.0);
  }
  for (const double t : {-1e-9, -10.0, std::nan("")}) {
    const Reference reference = trajectory.evaluate(t);
    EXPECT_EQ(reference.angle[0], 0.5);
    EXPECT_EQ(reference.speed[0], 0.0);
  }
}

TEST(Trajectory, refuses_jumps_of_angle_speed_and_acceleration) {
  const auto jump = [](std::size_t power) {
    Json table = trajectory_table();
    Json& coefficient = table["coefficients"][1][0][power];
    coefficient = coefficient.get<double>() + 1e-7;
    return refusal([&] { parse(table); });
  };
  EXPECT_THAT(jump(0), HasSubstr("t.json: coefficients[1][0]: got angle "));
  EXPECT_THAT(jump(1), HasSubstr("t.json: coefficients[1][0]: got speed "));
  EXPECT_THAT(jump(2), HasSubstr("t.json: coefficients[1][0]: got acceleration "));
  EXPECT_EQ(jump(3), "accepted") << "jerk may jump";
}

TEST(Trajectory, refuses_malformed_documents_and_names_the_field) {
  const auto refused = [](const std::string& pointer, const Json& value) {
    Json table = trajectory_table();
    table[Json::json_pointer(pointer)] = value;
    return refusal([&] { parse(table); });
  };
  EXPECT_THAT(refused("/schema", "quasilpv.artifact"), HasSubstr("schema: got \"quasilpv.artifact\""));
  EXPECT_THAT(refused("/schema_version", 2), HasSubstr("schema_version: got 2"));
  EXPECT_THAT(refused("/knots_s/0", 0.5), HasSubstr("knots_s[0]: got 0.5, expected 0"));
  EXPECT_THAT(refused("/knots_s/2", 0.75), HasSubstr("knots_s[2]: got 0.75"));
  EXPECT_THAT(refused("/knots_s", {0.0}), HasSubstr("knots_s: got 1 knots"));
  EXPECT_THAT(refused("/knots_s/3", 5.0), HasSubstr("coefficients: got 2 segments, expected 3"));
  EXPECT_THAT(refused("/coefficients/1/2", {0.0}), HasSubstr("coefficients[1]: got 3 joints, expected 2"));
  EXPECT_THAT(refused("/coefficients/1/0/6", 0.0), HasSubstr("coefficients[1][0]: got an array of 7"));
  EXPECT_THAT(refused("/coefficients/1/0/5", true), HasSubstr("coefficients[1][0][5]: got true"));
  EXPECT_THAT(refused("/joints", 8), HasSubstr("joints: got 8"));
  EXPECT_THAT(refused("/task", 1), HasSubstr("task: "));
  EXPECT_THAT(refused("/extra", 1), HasSubstr("unknown member \"extra\""));
}

}  // namespace
}  // namespace quasilpv
