// Strict reading of scenario documents: one broken rule at a time.
#include "quasilpv/scenario.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "quasilpv/document.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

Json valid_document() {
  return Json::parse(R"({
    "schema": "quasilpv.scenario", "schema_version": 1, "name": "swing", "duration_s": 3.0,
    "plant": {"kind": "serial-arm", "label": "arm2", "gravity_m_s2": 9.81, "links": [
      {"length_m": 1.0, "mass_kg": 5.0, "com_m": 0.5, "inertia_kg_m2": 2.0, "friction_nm_s": 0.1},
      {"length_m": 0.9, "mass_kg": 4.9, "com_m": 0.489, "inertia_kg_m2": 1.9, "friction_nm_s": 0.2}]},
    "integrator": {"kind": "ida", "relative_tolerance": 1e-8, "absolute_tolerance": 1e-10},
    "external_torque": [{"joint": 1, "amplitude_nm": 375.0, "frequency_rad_s": 15.0, "phase_rad": 0.5}],
    "sensors": {"encoder_bits": 20, "velocity_noise_rad_s": 0.05, "seed": 9007199254740991},
    "transport_delay_s": 0.0005,
    "initial": {"angle_rad": [0.1, 0.2], "speed_rad_s": [0.3, 0.4]}})");
}

std::string refusal(const Json& document) {
  try {
    Scenario::parse(document.dump(), "swing.json");
    return "accepted";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(Scenario, every_member_arrives_where_it_belongs) {
  const Scenario scenario = Scenario::parse(valid_document().dump(), "swing.json");
  EXPECT_EQ(scenario.name, "swing");
  EXPECT_EQ(scenario.duration_s, 3.0);
  EXPECT_EQ(scenario.joints(), 2);
  const auto& arm = std::get<SerialArmParameters>(scenario.plant);
  EXPECT_EQ(arm.label, "arm2");
  EXPECT_EQ(arm.gravity_m_s2, 9.81);
  EXPECT_EQ(arm.links[1].length_m, 0.9);
  EXPECT_EQ(arm.links[1].mass_kg, 4.9);
  EXPECT_EQ(arm.links[1].com_m, 0.489);
  EXPECT_EQ(arm.links[1].inertia_kg_m2, 1.9);
  EXPECT_EQ(arm.links[1].friction_nm_s, 0.2);
  EXPECT_EQ(std::get<IdaOptions>(scenario.integrator).relative_tolerance, 1e-8);
  EXPECT_EQ(std::get<IdaOptions>(scenario.integrator).absolute_tolerance, 1e-10);
  ASSERT_EQ(scenario.external_torque.size(), 1u);
  EXPECT_EQ(scenario.external_torque[0].joint, 1);
  EXPECT_EQ(scenario.external_torque[0].amplitude_nm, 375.0);
  EXPECT_EQ(scenario.external_torque[0].frequency_rad_s, 15.0);
  EXPECT_EQ(scenario.external_torque[0].phase_rad, 0.5);
  EXPECT_EQ(scenario.sensors.encoder_bits, 20);
  EXPECT_EQ(scenario.sensors.velocity_noise_rad_s, 0.05);
  EXPECT_EQ(scenario.sensors.seed, 9007199254740991u);
  EXPECT_EQ(scenario.transport_delay_s, 0.0005);
  EXPECT_EQ(scenario.initial_angle, (JointArray{0.1, 0.2}));
  EXPECT_EQ(scenario.initial_speed, (JointArray{0.3, 0.4}));
}

TEST(Scenario, a_runge_kutta_integrator_is_read) {
  Json document = valid_document();
  document["integrator"] = {{"kind", "rk4"}, {"steps_per_sample", 4}};
  const Scenario scenario = Scenario::parse(document.dump(), "swing.json");
  EXPECT_EQ(std::get<Rk4Options>(scenario.integrator).steps_per_sample, 4);
}

TEST(Scenario, the_plant_it_makes_carries_the_external_torque_and_no_control_torque) {
  const auto plant = Scenario::parse(valid_document().dump(), "swing.json").make_plant();
  EXPECT_EQ(plant->joints(), 2);
  EXPECT_EQ(plant->torque(), JointArray{});
  EXPECT_DOUBLE_EQ(plant->external_torque().at(0.0)[1], 375.0 * std::sin(0.5));
}

struct BrokenRule {
  const char* pointer;
  Json value;
  const char* message;
};

class BrokenScenario : public ::testing::TestWithParam<BrokenRule> {};

TEST_P(BrokenScenario, is_refused_in_one_line_naming_file_and_field) {
  Json document = valid_document();
  document[Json::json_pointer(GetParam().pointer)] = GetParam().value;
  const std::string message = refusal(document);
  EXPECT_THAT(message, StartsWith("swing.json: "));
  EXPECT_THAT(message, HasSubstr(GetParam().message));
  EXPECT_EQ(message.find('\n'), std::string::npos);
}

const std::vector<BrokenRule> kBrokenRules{
    {"/schema", "quasilpv.artifact", "schema"},
    {"/schema_version", 2, "schema_version"},
    {"/name", "", "name"},
    {"/duration_s", 0.0, "duration_s"},
    {"/duration_s", "3", "duration_s"},
    {"/comment", "hello", "comment"},
    {"/plant/kind", "five-link", "plant.kind"},
    {"/plant/gravity_m_s2", nullptr, "plant.gravity_m_s2"},
    {"/plant/colour", "red", "colour"},
    {"/plant/links", Json::array(), "plant.links"},
    {"/plant/links/0/length_m", 0.0, "plant.links[0].length_m"},
    {"/plant/links/1/mass_kg", -4.9, "plant.links[1].mass_kg"},
    {"/plant/links/1/inertia_kg_m2", 0.0, "plant.links[1].inertia_kg_m2: got 0, expected a number > 0 (indefinite"},
    {"/plant/links/1/inertia_kg_m2", -1.9, "plant.links[1].inertia_kg_m2: got -1.9"},
    {"/plant/links/1/inertia_kg_m2", 1.1, "got 1.1, expected >= mass_kg com_m^2 = 1.1716929"},
    {"/plant/links/1/friction_nm_s", -0.1, "plant.links[1].friction_nm_s"},
    {"/plant/links/1/colour", "red", "colour"},
    {"/integrator/kind", "euler", "integrator.kind"},
    {"/integrator/relative_tolerance", 0.0, "integrator.relative_tolerance"},
    {"/integrator/steps_per_sample", 4, "steps_per_sample"},
    {"/integrator", Json{{"kind", "rk4"}, {"steps_per_sample", 0}}, "integrator.steps_per_sample"},
    {"/external_torque/0/joint", 2, "external_torque[0].joint"},
    {"/external_torque/0/joint", 0.5, "external_torque[0].joint"},
    {"/external_torque/0/shape", "sine", "shape"},
    {"/external_torque", Json::object(), "external_torque"},
    {"/sensors/encoder_bits", 33, "sensors.encoder_bits"},
    {"/sensors/encoder_bits", 3.7, "sensors.encoder_bits"},
    {"/sensors/velocity_noise_rad_s", -0.1, "sensors.velocity_noise_rad_s"},
    {"/sensors/seed", -1, "sensors.seed"},
    {"/transport_delay_s", -1e-3, "transport_delay_s"},
    {"/initial/angle_rad", Json::array({0.1}), "initial.angle_rad"},
    {"/initial/speed_rad_s", Json::array({0.1, 0.2, 0.3}), "initial.speed_rad_s"},
    {"/initial/speed_rad_s/1", "fast", "initial.speed_rad_s[1]"},
};

INSTANTIATE_TEST_SUITE_P(OneRuleAtATime, BrokenScenario, ::testing::ValuesIn(kBrokenRules));

TEST(Scenario, when_any_member_is_missing_expect_refusal_naming_it) {
  const Json complete = valid_document();
  for (const auto& [key, value] : complete.items()) {
    Json document = complete;
    document.erase(key);
    EXPECT_THAT(refusal(document), HasSubstr(key));
    if (value.is_object()) {
      for (const auto& [inner, unused] : value.items()) {
        document = complete;
        document[key].erase(inner);
        EXPECT_THAT(refusal(document), HasSubstr(key + "." + inner));
      }
    }
  }
}

TEST(Scenario, when_a_key_is_given_twice_expect_refusal) {
  std::string text = valid_document().dump();
  text.insert(1, R"("name": "other", )");
  EXPECT_THROW(Scenario::parse(text, "swing.json"), InputError);
}

TEST(Scenario, when_the_file_is_missing_expect_an_input_error) {
  EXPECT_THROW(Scenario::load("/nonexistent/scenario.json"), InputError);
}

}  // namespace
}  // namespace quasilpv
