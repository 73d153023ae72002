#include "quasilpv/system_controller.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "quasilpv/equation_plant.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/system_simulation.hpp"
#include "system_fixture.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::refusal;
using ::quasilpv::testing::system_table;
using ::testing::HasSubstr;

SystemArtifact pendulum() { return SystemArtifact::parse(json_twin(system_table()), "test"); }

double sinc(double x) { return x == 0.0 ? 1.0 : std::sin(x) / x; }

TEST(SystemController, applies_the_scheduled_gain_to_deviations_and_adds_the_trim) {
  SystemController controller(pendulum());
  const std::array<double, 2> state = {1.25, -0.5};
  const SystemReport report = controller.step(state.data(), nullptr);
  const double z = 9.0 * sinc(0.25);
  EXPECT_DOUBLE_EQ(report.premise[0], z);
  EXPECT_NEAR(report.input[0], 0.5 + (-10.0 - z) * 0.25 + 4.0 * 0.5, 1e-14);
  EXPECT_EQ(report.input, report.commanded);
  EXPECT_DOUBLE_EQ(report.level, 0.25 * 0.25 / 0.25 + 0.5 * 0.5 / 4.0);
  EXPECT_EQ(report.flags, kSystemHealthy);
}

TEST(SystemController, clamps_the_input_to_its_limits_and_the_premise_to_its_box_and_says_so) {
  SystemController controller(pendulum());
  const std::array<double, 2> state = {1.0 + 3.0, 0.0};
  const SystemReport report = controller.step(state.data(), nullptr);
  EXPECT_EQ(report.premise[0], 5.0);
  EXPECT_EQ(report.input[0], 0.5 - 6.0);
  EXPECT_NEAR(report.commanded[0], 0.5 - 15.0 * 3.0, 1e-13);
  EXPECT_EQ(report.flags, kSystemPremiseOutside | kInputSaturated | kOutsideRegion);
}

TEST(SystemController, keeps_the_last_input_while_a_signal_is_not_a_number) {
  SystemController controller(pendulum());
  const std::array<double, 2> good = {1.1, 0.2};
  const std::array<double, 2> bad = {1.1, std::numeric_limits<double>::quiet_NaN()};
  EXPECT_EQ(controller.step(bad.data(), nullptr).input[0], 0.5);
  const double last = controller.step(good.data(), nullptr).input[0];
  const SystemReport report = controller.step(bad.data(), nullptr);
  EXPECT_EQ(report.input[0], last);
  EXPECT_EQ(report.flags, kSignalInvalid);
  controller.reset();
  EXPECT_EQ(controller.step(bad.data(), nullptr).input[0], 0.5);
}

TEST(EquationPlant, has_the_residual_the_slope_and_the_rates_of_its_equations) {
  const SystemArtifact artifact = pendulum();
  const SystemDisturbance nothing;
  EquationPlant plant(artifact, {}, nothing);
  const double input = 2.0;
  plant.set_input(&input);
  const Eigen::Vector2d y(0.3, -0.4);
  const Eigen::Vector2d y_dot(0.7, 0.1);
  Eigen::VectorXd residual(2);
  plant.residual(0.0, y, y_dot, residual);
  EXPECT_NEAR(residual[0], 0.7 + 0.4, 1e-15);
  EXPECT_NEAR(residual[1], 0.1 - 9.0 * std::sin(0.3) - 2.0, 1e-14);
  Eigen::MatrixXd slope(2, 2);
  plant.jacobian(0.0, 5.0, y, y_dot, slope);
  EXPECT_NEAR(slope(0, 0), 5.0, 1e-15);
  EXPECT_NEAR(slope(0, 1), -1.0, 1e-15);
  EXPECT_NEAR(slope(1, 0), -9.0 * std::cos(0.3), 1e-14);
  EXPECT_NEAR(slope(1, 1), 5.0, 1e-15);
  Eigen::VectorXd rate(2);
  plant.derivative(0.0, y, rate);
  EXPECT_NEAR(rate[0], -0.4, 1e-14);
  EXPECT_NEAR(rate[1], 9.0 * std::sin(0.3) + 2.0, 1e-13);
}

TEST(SystemSimulation, settles_the_pendulum_the_same_under_both_integrators) {
  const SystemArtifact artifact = pendulum();
  SystemScenario experiment;
  experiment.start = {1.2, 0.0};
  experiment.samples = 500;
  experiment.integrator = IdaOptions{1e-10, 1e-12};
  const SystemRun ida = simulate_system(artifact, experiment);
  experiment.integrator = Rk4Options{10};
  const SystemRun rk4 = simulate_system(artifact, experiment);
  const std::vector<double>& by_ida = ida.samples["state"].values;
  const std::vector<double>& by_rk4 = rk4.samples["state"].values;
  ASSERT_EQ(by_ida.size(), 1000U);
  ASSERT_EQ(by_rk4.size(), by_ida.size());
  for (std::size_t k = 0; k < by_ida.size(); ++k) {
    EXPECT_NEAR(by_ida[k], by_rk4[k], 1e-7);
  }
  EXPECT_NEAR(by_ida[998], 1.0, 1e-3);
  EXPECT_FALSE(ida.exit.has_value());
}

TEST(SystemSimulation, ends_where_a_state_leaves_its_domain) {
  SystemScenario experiment;
  experiment.start = {2.49, 9.0};
  experiment.samples = 100;
  const SystemRun run = simulate_system(pendulum(), experiment);
  ASSERT_TRUE(run.exit.has_value());
  EXPECT_EQ(run.exit->state, 0);
  EXPECT_LT(run.samples["time_s"].samples(), 5U);
}

TEST(SystemSimulation, delays_an_input_by_at_most_one_sample) {
  const SystemArtifact artifact = pendulum();
  SystemScenario experiment;
  experiment.start = {1.2, 0.0};
  experiment.samples = 50;
  experiment.delay_s = artifact.sample_period_s();
  const SystemRun late = simulate_system(artifact, experiment);
  // Until the first input arrives the trim acts: the pendulum falls freely.
  EXPECT_NEAR(late.samples["state"].values[3], 9.0 * std::sin(0.2) * 0.01, 1e-5);
  experiment.delay_s = 0.02;
  EXPECT_THAT(refusal([&] { simulate_system(artifact, experiment); }), HasSubstr("delay_s"));
}

struct Damage {
  const char* field;
  std::function<void(Json&)> change;
};

TEST(SystemArtifact, refuses_what_does_not_fit_and_names_it) {
  const std::vector<Damage> damages = {
      {"signals", [](Json& t) { t["signals"] = Json::array(); }},
      {"signals[1].role", [](Json& t) { t["signals"][1]["role"] = "output"; }},
      {"signals[2].role", [](Json& t) { std::swap(t["signals"][1], t["signals"][2]); }},
      {"signals[0].high", [](Json& t) { t["signals"][0]["high"] = -2; }},
      {"model.differential", [](Json& t) { t["model"]["differential"] = 3; }},
      {"law.kind", [](Json& t) { t["law"]["kind"] = "pid"; }},
      {"law.gain", [](Json& t) { t["law"]["gain"]["blocks"][0]["vertices"][0] = Json::parse("[[1]]"); }},
      {"law.schedule", [](Json& t) { t["law"]["schedule"]["code"][0] = Json::parse(R"(["signal", 3])"); }},
      {"law.schedule", [](Json& t) { t["law"]["schedule"]["code"][0] = Json::parse(R"(["angle", 0])"); }},
      {"region.lyapunov", [](Json& t) { t["region"]["lyapunov"] = Json::parse("[[1, 2], [2, 1]]"); }},
      {"plant.residual", [](Json& t) { t["plant"]["residual"]["code"][0] = Json::parse(R"(["signal", 5])"); }},
      {"plant.jacobian", [](Json& t) { t["plant"]["jacobian"].erase(0); }},
      {"sample_period_s", [](Json& t) { t["sample_period_s"] = 0; }},
      {"extra", [](Json& t) { t["extra"] = 1; }},
  };
  for (const Damage& damage : damages) {
    Json table = system_table();
    damage.change(table);
    EXPECT_THAT(refusal([&] { SystemArtifact::parse(json_twin(table), "test"); }), HasSubstr(damage.field))
        << damage.field;
  }
}

}  // namespace
}  // namespace quasilpv
