// Disturbances of general systems: when terms act, where integration has to stop, what documents may say.
#include "quasilpv/system_disturbance.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "quasilpv/errors.hpp"
#include "quasilpv/system_session.hpp"
#include "system_fixture.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::system_table;

TEST(SystemDisturbance, a_step_acts_from_its_beginning_until_its_end) {
  DisturbanceTerm step;
  step.size = 2.0;
  step.begin_s = 0.3;
  step.end_s = 0.5;
  SystemDisturbance disturbance({step});
  for (const auto& [time_s, value] : {std::pair(0.0, 0.0), {0.299, 0.0}, {0.3, 2.0}, {0.49, 2.0}, {0.5, 0.0}}) {
    disturbance.begin(time_s);
    std::array<double, 1> signal{};
    disturbance.add(time_s, signal.data());
    EXPECT_EQ(signal[0], value) << time_s;
  }
  EXPECT_EQ(disturbance.next_edge(0.0, 1.0), 0.3);
  EXPECT_EQ(disturbance.next_edge(0.3, 1.0), 0.5);
  EXPECT_EQ(disturbance.next_edge(0.5, 1.0), 1.0);
}

TEST(SystemDisturbance, a_sine_is_continuous_and_noise_is_held_over_a_sample) {
  DisturbanceTerm sine;
  sine.kind = DisturbanceTerm::Kind::kSine;
  sine.size = 3.0;
  sine.frequency_rad_s = 5.0;
  sine.phase_rad = 0.2;
  DisturbanceTerm noise;
  noise.kind = DisturbanceTerm::Kind::kNoise;
  noise.signal = 1;
  noise.size = 1.0;
  SystemDisturbance disturbance({sine, noise});
  double last = 0.0;
  for (int sample = 0; sample < 3; ++sample) {
    disturbance.draw();
    disturbance.begin(sample);
    std::array<double, 2> at_begin{};
    std::array<double, 2> later{};
    disturbance.add(sample, at_begin.data());
    disturbance.add(sample + 0.7, later.data());
    EXPECT_DOUBLE_EQ(later[0], 3.0 * std::sin(5.0 * (sample + 0.7) + 0.2));
    EXPECT_EQ(later[1], at_begin[1]);
    EXPECT_NE(later[1], last);
    last = later[1];
  }
}

TEST(SystemDisturbance, a_step_inside_a_sample_moves_a_double_integrator_as_it_must) {
  Json table = system_table();
  table["plant"]["residual"]["code"] = Json::parse(R"([["signal", 3], ["signal", 1], ["sub"],
    ["signal", 4], ["signal", 2], ["sub"]])");
  table["plant"]["jacobian"][1]["code"] = Json::parse(R"([["const", 0], ["const", 1], ["const", 0], ["const", 0]])");
  const SystemArtifact artifact = SystemArtifact::parse(json_twin(table), "test");
  SystemScenario scenario;
  scenario.start = {1.0, 0.0};
  scenario.samples = 3;
  scenario.integrator = IdaOptions{1e-10, 1e-12};
  DisturbanceTerm step;
  step.signal = 2;  // the input
  step.size = 4.0;
  step.begin_s = 0.003;
  scenario.disturbances = {step};
  SystemSession session(artifact, scenario);
  session.advance({0.5});
  EXPECT_NEAR(session.truth()[1], 4.0 * 0.007, 1e-10);
  EXPECT_NEAR(session.truth()[0], 1.0 + 0.5 * 4.0 * 0.007 * 0.007, 1e-10);
}

TEST(SystemDisturbance, documents_name_what_is_wrong) {
  const SystemArtifact artifact = SystemArtifact::parse(json_twin(system_table()), "test");
  const auto parse = [&](const char* terms) {
    Json scenario = Json::parse(R"({"schema": "quasilpv.system_scenario", "schema_version": 1, "name": "test",
      "samples": 2, "start": {"x": 1, "v": 0}, "parameters": {}, "integrator": {"kind": "rk4", "steps_per_sample": 1},
      "delay_s": 0, "sensors": {"noise": {"x": 0, "v": 0}, "quantum": {"x": 0, "v": 0}, "seed": 1}})");
    scenario["disturbances"] = Json::parse(terms);
    return SystemScenario::parse(scenario.dump(), "test", artifact);
  };
  EXPECT_EQ(parse(R"([{"kind": "constant", "signal": "v", "value": 2, "begin_s": 1, "end_s": null}])")
                .disturbances.at(0)
                .signal,
            1U);
  EXPECT_THROW(parse(R"([{"kind": "constant", "signal": "z", "value": 2, "begin_s": 0, "end_s": null}])"), InputError);
  EXPECT_THROW(parse(R"([{"kind": "ramp", "signal": "v", "value": 2, "begin_s": 0, "end_s": null}])"), InputError);
  EXPECT_THROW(parse(R"([{"kind": "noise", "signal": "v", "deviation": -2, "seed": 1, "begin_s": 0, "end_s": 1}])"),
               InputError);
  EXPECT_THROW(parse(R"([{"kind": "sine", "signal": "u", "value": 2, "begin_s": 0, "end_s": null}])"), InputError);
}

}  // namespace
}  // namespace quasilpv
