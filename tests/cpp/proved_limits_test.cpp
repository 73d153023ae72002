// What the loop does when a robot in space leaves the angles and speeds its proof assumes (fault F27).
#include "quasilpv/proved_limits.hpp"

#include <gtest/gtest.h>

#include <array>

#include "loop_fixture.hpp"
#include "not_finite.hpp"

namespace quasilpv::testing {
namespace {

constexpr double T = kSamplePeriod;

Json spatial_table() {
  Json table = with_chain(artifact_table("dob-acceleration", kJoints));
  table["domain"]["angle_rad"] = {{-1.0, 1.0}, {-4.0, 4.0}, {-2.0, 2.0}};
  table["domain"]["speed_rad_s"] = std::vector<Json>(kJoints, Json::array({-3.0, 3.0}));
  return table;
}

Json moving_table() {
  Json table = spatial_table();
  table["law"]["motion_limits"] = {{"angle_rad", {{-0.9, 0.9}, {-4.0, 4.0}, {-1.0, 1.0}}},
                                   {"speed_rad_s", {0.5, 1.0, 1.5}}};
  return table;
}

Artifact parsed(const Json& table) { return Artifact::parse(json_twin(table), "test"); }

TEST(ProvedLimits, are_the_domains_angles_and_no_speeds_of_a_robot_in_space) {
  const ProvedLimits limits(parsed(spatial_table()));
  const JointArray still{};
  EXPECT_FALSE(limits.is_outside({0.99, 0.0, -1.99}, {3.0, 30.0, -300.0}));
  EXPECT_TRUE(limits.is_outside({1.01, 0.0, 0.0}, still));
  EXPECT_TRUE(limits.is_outside({0.0, 0.0, -2.01}, still));
  EXPECT_FALSE(limits.is_outside({0.0, 40.0, 0.0}, still));  // more than a turn: every angle occurs
}

TEST(ProvedLimits, are_those_of_the_motions_a_law_was_designed_for) {
  const ProvedLimits limits(parsed(moving_table()));
  const JointArray centre{};
  EXPECT_FALSE(limits.is_outside({0.89, 9.0, -0.99}, {-0.49, 0.99, 1.49}));
  EXPECT_TRUE(limits.is_outside({0.91, 0.0, 0.0}, {}));
  for (std::size_t j = 0; j < kJoints; ++j) {
    for (const double sign : {-1.0, 1.0}) {
      JointArray speed{};
      speed[j] = sign * (0.51 + 0.5 * static_cast<double>(j));
      EXPECT_TRUE(limits.is_outside(centre, speed)) << j;
    }
  }
}

TEST(ProvedLimits, are_none_for_a_planar_robot_whose_premises_tell) {
  const ProvedLimits limits(artifact());
  EXPECT_FALSE(limits.is_outside({100.0, -100.0, 50.0}, {1e3, 1e3, 1e3}));
}

TEST(ProvedLimits, say_nothing_of_what_is_no_number) {
  const ProvedLimits limits(parsed(moving_table()));
  EXPECT_FALSE(limits.is_outside({kNaN, 0.0, 0.0}, {0.0, kNaN, 0.0}));
}

TEST(ProvedLimits, of_motions_are_read_strictly) {
  const auto refused = [](const char* member, const Json& value) {
    Json table = moving_table();
    table["law"]["motion_limits"][member] = value;
    return refusal([&] { parsed(table); });
  };
  EXPECT_NE(refused("angle_rad", {{-1.0, 1.0}, {-1.0, 1.0}}).find("law.motion_limits.angle_rad"), std::string::npos);
  EXPECT_NE(refused("angle_rad", {{-1.0, 1.0}, {1.0, -1.0}, {0.0, 1.0}}).find("motion_limits.angle_rad[1]"),
            std::string::npos);
  EXPECT_NE(refused("speed_rad_s", {1.0, 0.0, 1.0}).find("law.motion_limits.speed_rad_s[1]"), std::string::npos);
  EXPECT_NE(refused("speed_rad_s", {1.0, 1.0}).find("law.motion_limits.speed_rad_s"), std::string::npos);
  EXPECT_NE(refused("more", 1.0).find("more"), std::string::npos);
}

/// How the loop judges joint 0 at `angle(seq)`; the sample at which it latched a fault, or -1.
template <class Angle>
std::int64_t fault_at(ControlLoop& loop, Angle angle, std::int64_t samples) {
  for (std::int64_t seq = 0; seq < samples; ++seq) {
    loop.handle(reading(seq, {angle(seq), kStart[1], kStart[2]}), at(seq));
    if (loop.state() == ControllerState::kFault) {
      return seq;
    }
  }
  return -1;
}

TEST(ProvedLimits, F27_an_angle_beyond_the_domain_is_degraded_at_once_and_a_fault_at_the_20th_sample) {
  const auto creep = [](std::int64_t seq) { return 0.95 + 0.5 * T * static_cast<double>(seq); };  // out after 100
  const Artifact law = parsed(spatial_table());
  ControlLoop loop(law, trajectory(), {});
  EXPECT_EQ(fault_at(loop, creep, 300), 120);
  EXPECT_EQ(loop.cause(), FaultCause::kOutsideProof);
  EXPECT_NE(loop.flags() & kOutsideProof, 0u);

  ControlLoop brief(law, trajectory(), {});
  const auto back = [&](std::int64_t seq) { return seq < 115 ? creep(seq) : creep(230 - seq); };
  EXPECT_EQ(fault_at(brief, back, 109), -1);
  EXPECT_EQ(brief.state(), ControllerState::kDegraded);
  ControlLoop returned(law, trajectory(), {});
  const auto shorter = [&](std::int64_t seq) { return seq < 109 ? creep(seq) : creep(218 - seq); };
  EXPECT_EQ(fault_at(returned, shorter, 218), -1);
  EXPECT_EQ(returned.state(), ControllerState::kRunning);
}

TEST(ProvedLimits, F27_a_speed_beyond_the_motions_of_the_proof_is_a_fault_and_within_them_none) {
  const Artifact law = parsed(moving_table());
  const auto moving = [](double speed) {
    return [speed](std::int64_t seq) { return -0.3 + speed * T * static_cast<double>(seq); };
  };
  ControlLoop slow(law, trajectory(), {});
  EXPECT_EQ(fault_at(slow, moving(0.4), 1500), -1);
  ControlLoop fast(law, trajectory(), {});
  const std::int64_t seq = fault_at(fast, moving(0.6), 1500);
  EXPECT_GT(seq, 19);
  EXPECT_LT(seq, 1000);
  EXPECT_EQ(fast.cause(), FaultCause::kOutsideProof);
}

TEST(ProvedLimits, F27_a_start_outside_the_motions_of_the_proof_is_refused) {
  ControlLoop loop(parsed(moving_table()), trajectory(), {});
  loop.handle(reading(0, {0.95, kStart[1], kStart[2]}), at(0));
  ASSERT_TRUE(loop.refusal().has_value());
  EXPECT_EQ(loop.refusal()->joint, 0);
  EXPECT_EQ(loop.refusal()->expected.high, 0.9);
}

TEST(ProvedLimits, F27_a_reset_waits_until_the_joint_is_back) {
  ControlLoop loop(parsed(spatial_table()), trajectory(), {});
  const auto creep = [](std::int64_t seq) { return 0.95 + 0.5 * T * static_cast<double>(seq); };
  const std::int64_t last = fault_at(loop, creep, 300);
  ASSERT_GT(last, 0);
  EXPECT_FALSE(loop.reset_fault());
  for (std::int64_t seq = last + 1; seq < last + 100; ++seq) {
    loop.handle(reading(seq, {creep(2 * last - seq), kStart[1], kStart[2]}), at(seq));
  }
  EXPECT_TRUE(loop.reset_fault());
}

}  // namespace
}  // namespace quasilpv::testing
