#include "quasilpv/system_controller.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
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
using ::quasilpv::testing::observed_table;
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

SystemArtifact observed_pendulum() { return SystemArtifact::parse(json_twin(observed_table()), "test"); }

/// The input, limited, and h of the next sample, by hand.
struct ByHand {
  double x = 0.0;  // h
  double v = 0.25;

  double input(double y) const {
    const double z = 9.0 * sinc(y);
    return std::clamp((-10.0 - z) * y - 4.0 * v, -6.0, 6.0);
  }
  void predict(double xi, double u, double innovation) {
    const double rate = 9.0 * sinc(xi) * xi + u;
    const double speed = v;
    x += 0.01 * speed + 0.25 * innovation;
    v += 0.01 * rate + 2.0 * innovation;
  }
};

TEST(SystemObserver, estimates_what_is_not_measured_and_never_reads_it) {
  SystemController controller(observed_pendulum());
  ByHand h;
  h.x = 0.3;  // the first measurement
  for (int k = 0; k < 20; ++k) {
    const double y = 0.3 - 0.01 * k;
    const std::array<double, 2> state = {1.0 + y, std::numeric_limits<double>::quiet_NaN()};
    const SystemReport report = controller.step(state.data(), nullptr);
    EXPECT_NEAR(report.input[0], 0.5 + h.input(y), 1e-12);
    EXPECT_EQ(report.state[0], 1.0 + (state[0] - 1.0));
    EXPECT_NEAR(report.state[1], h.v, 1e-12);
    EXPECT_NEAR(report.level, y * y / 0.25 + h.v * h.v / 4.0, 1e-12);
    EXPECT_EQ(report.flags & kSignalInvalid, 0u);
    h.predict(y, report.input[0] - 0.5, y - h.x);
  }
}

TEST(SystemObserver, predicts_without_a_measurement_under_the_input_that_acts) {
  SystemController controller(observed_pendulum());
  const std::array<double, 2> good = {1.2, 0.0};
  const std::array<double, 2> bad = {std::numeric_limits<double>::quiet_NaN(), 0.0};
  ByHand h;
  h.x = good[0] - 1.0;
  const double u = controller.step(good.data(), nullptr).input[0] - 0.5;
  h.predict(h.x, u, 0.0);
  const SystemReport missed = controller.step(bad.data(), nullptr);
  EXPECT_EQ(missed.flags, kSignalInvalid);
  EXPECT_EQ(missed.input[0], 0.5 + u);
  EXPECT_NEAR(missed.state[0], 1.0 + h.x, 1e-12);
  EXPECT_NEAR(missed.state[1], h.v, 1e-12);
  const double brake = 0.5;  // what a loop in Fault gives instead
  controller.applied(&brake);
  h.predict(h.x, 0.0, 0.0);
  EXPECT_NEAR(controller.step(bad.data(), nullptr).state[1], h.v, 1e-12);
}

TEST(SystemObserver, begins_again_as_stated_or_as_it_is_told) {
  SystemController controller(observed_pendulum());
  const std::array<double, 2> state = {1.2, 0.0};
  const SystemReport first = controller.step(state.data(), nullptr);
  controller.step(state.data(), nullptr);
  controller.reset();
  EXPECT_EQ(controller.step(state.data(), nullptr).state, first.state);
  const std::array<double, 2> told = {1.1, -0.5};
  controller.reset(told.data());
  const SystemReport report = controller.step(state.data(), nullptr);
  EXPECT_EQ(report.state[1], -0.5);
  ByHand h;
  h.x = 0.1;
  h.v = -0.5;
  h.predict(0.2, report.input[0] - 0.5, 0.2 - 0.1);
  EXPECT_NEAR(controller.step(state.data(), nullptr).state[1], h.v, 1e-12);
}

TEST(SystemObserver, without_a_first_measurement_nothing_is_estimated) {
  SystemController controller(observed_pendulum());
  const std::array<double, 2> bad = {std::numeric_limits<double>::quiet_NaN(), 0.0};
  EXPECT_EQ(controller.step(bad.data(), nullptr).flags, kSignalInvalid);
  const std::array<double, 2> good = {1.2, 0.0};
  EXPECT_EQ(controller.step(good.data(), nullptr).state[1], 0.25);
}

TEST(SystemObserver, is_refused_where_it_does_not_fit_the_system) {
  const auto refused = [](const std::function<void(Json&)>& change) {
    Json table = observed_table();
    change(table);
    return refusal([&] { SystemArtifact::parse(json_twin(table), "test"); });
  };
  EXPECT_THAT(refused([](Json& t) { t["observer"]["measured"] = {"v", "x"}; }), HasSubstr("observer.measured"));
  EXPECT_THAT(refused([](Json& t) { t["observer"]["measured"] = {"w"}; }), HasSubstr("observer.measured"));
  EXPECT_THAT(refused([](Json& t) { t["observer"]["gain"] = {{1.0, 2.0}, {0.0, 0.0}}; }), HasSubstr("observer.gain"));
  EXPECT_THAT(refused([](Json& t) { t["observer"]["start"] = {0.0}; }), HasSubstr("observer.start"));
  EXPECT_THAT(refused([](Json& t) {
                t["schema_version"] = 1;
                t["law"].erase("premise_fault_s");
              }),
              HasSubstr("observer"));
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
