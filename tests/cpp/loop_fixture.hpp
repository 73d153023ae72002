// One small experiment for the tests of both loops: law, reference, plant, messages.
#pragma once

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
Trajectory trajectory();

/// With a Lyapunov bound for the monitor, where the kind has one. The domain holds the speeds to which the disturbances
/// of these runs drive the light arm.
Artifact artifact(const std::string& kind = "dob-acceleration", double fastest_rad_s = 50.0);

/// Every imperfection on: a difference in the order of calls or in the number of noise samples shows.
Scenario scenario(std::int64_t samples);

/// The run that every other way of running `experiment` must repeat bit for bit.
RunRecord run_in_process(const Artifact& law, const Scenario& experiment);

WireIdentity identity_of(const Artifact& artifact);

measurement_v3 measurement(std::int64_t seq, const JointArray& angle = kStart);

RobotReading reading(std::int64_t seq, const JointArray& angle = kStart);

SampleConditions at(std::int64_t seq);

}  // namespace quasilpv::testing
