// Strict reading of scenario documents: one broken rule at a time.
#include "quasilpv/scenario.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "document/document.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/five_bar.hpp"
#include "quasilpv/serial_arm.hpp"
#include "quasilpv/spring_disc.hpp"

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

Json with_plant(Json plant, int joints) {
  Json document = valid_document();
  document["plant"] = std::move(plant);
  document["external_torque"][0]["joint"] = 0;
  document["initial"] = {{"angle_rad", std::vector<double>{-0.8, 0.7}}, {"speed_rad_s", std::vector<double>{0.3, 0.4}}};
  if (joints == 1) {
    document["initial"] = {{"angle_rad", Json::array({-2.5})}, {"speed_rad_s", Json::array({5.0})}};
  }
  return document;
}

Json five_bar_document() {
  return with_plant(Json::parse(R"({
    "kind": "five-bar", "label": "legs", "gravity_m_s2": 9.81,
    "active": {"length_m": 0.165, "mass_kg": 0.0825, "com_m": 0.08, "inertia_kg_m2": 0.0011, "friction_nm_s": 0.001},
    "passive": {"length_m": 0.2, "mass_kg": 0.07, "com_m": 0.09, "inertia_kg_m2": 0.0007, "friction_nm_s": 0.002},
    "spring_nm_rad": 2.0, "spring_rest_rad": [-0.9, 0.9], "formulation": "ggl", "baumgarte_per_s": 40.0})"),
                    2);
}

Json spring_disc_document() {
  return with_plant(Json::parse(R"({
    "kind": "spring-disc", "label": "disc", "mass_kg": 0.1, "radius_m": 2.0, "inertia_kg_m2": 4.0,
    "inertia_uncertainty_per_kg": 3.0, "stiffness_n_m": 1.5, "cubic_stiffness_n_m3": 2.5, "damping_n_s_m": 0.5})"),
                    1);
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
  const auto plant = scenario.make_plant();
  const auto& arm = dynamic_cast<const SerialArm&>(*plant).parameters();
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

TEST(Scenario, every_member_of_a_five_bar_arrives_where_it_belongs) {
  const Scenario scenario = Scenario::parse(five_bar_document().dump(), "swing.json");
  EXPECT_EQ(scenario.joints(), 2);
  const auto plant = scenario.make_plant();
  const auto& five_bar = dynamic_cast<const FiveBar&>(*plant).parameters();
  EXPECT_EQ(five_bar.label, "legs");
  EXPECT_EQ(five_bar.gravity_m_s2, 9.81);
  EXPECT_EQ(five_bar.active.com_m, 0.08);
  EXPECT_EQ(five_bar.active.friction_nm_s, 0.001);
  EXPECT_EQ(five_bar.passive.length_m, 0.2);
  EXPECT_EQ(five_bar.passive.mass_kg, 0.07);
  EXPECT_EQ(five_bar.passive.inertia_kg_m2, 0.0007);
  EXPECT_EQ(five_bar.spring_nm_rad, 2.0);
  EXPECT_EQ(five_bar.spring_rest_rad, (std::array<double, 2>{-0.9, 0.9}));
  EXPECT_EQ(five_bar.formulation, FiveBarFormulation::kGgl);
  EXPECT_EQ(five_bar.baumgarte_per_s, 40.0);
  EXPECT_EQ(scenario.make_plant()->size(), 12);
  Json index1 = five_bar_document();
  index1["plant"]["formulation"] = "index1";
  EXPECT_EQ(Scenario::parse(index1.dump(), "swing.json").make_plant()->size(), 10);
}

TEST(Scenario, every_member_of_a_spring_disc_arrives_where_it_belongs) {
  const Scenario scenario = Scenario::parse(spring_disc_document().dump(), "swing.json");
  EXPECT_EQ(scenario.joints(), 1);
  const auto plant = scenario.make_plant();
  const auto& disc = dynamic_cast<const SpringDisc&>(*plant).parameters();
  EXPECT_EQ(disc.label, "disc");
  EXPECT_EQ(disc.mass_kg, 0.1);
  EXPECT_EQ(disc.radius_m, 2.0);
  EXPECT_EQ(disc.inertia_kg_m2, 4.0);
  EXPECT_EQ(disc.inertia_uncertainty_per_kg, 3.0);
  EXPECT_EQ(disc.stiffness_n_m, 1.5);
  EXPECT_EQ(disc.cubic_stiffness_n_m3, 2.5);
  EXPECT_EQ(disc.damping_n_s_m, 0.5);
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
  Json (*document)() = valid_document;
};

class BrokenScenario : public ::testing::TestWithParam<BrokenRule> {};

TEST_P(BrokenScenario, is_refused_in_one_line_naming_file_and_field) {
  Json document = GetParam().document();
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
    {"/duration_s", 1e15, "duration_s"},
    {"/integrator/relative_tolerance", 1e300, "integrator.relative_tolerance"},
    {"/plant/links/0/length_m", 1e-300, "plant.links[0].length_m"},
    {"/external_torque/0/amplitude_nm", 1e300, "external_torque[0].amplitude_nm"},
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
    {"/sensors/velocity_filter_time_constant_s", -1e-3, "sensors.velocity_filter_time_constant_s"},
    {"/transport_delay_s", -1e-3, "transport_delay_s"},
    {"/torque_limit_nm", Json::array({1.0}), "torque_limit_nm"},
    {"/torque_limit_nm", Json::array({1.0, 0.0}), "torque_limit_nm[1]"},
    {"/initial/angle_rad", Json::array({0.1}), "initial.angle_rad"},
    {"/initial/speed_rad_s", Json::array({0.1, 0.2, 0.3}), "initial.speed_rad_s"},
    {"/initial/speed_rad_s/1", "fast", "initial.speed_rad_s[1]"},
    {"/plant/links", Json::array(), "links", five_bar_document},
    {"/plant/formulation", "index3", "plant.formulation: got \"index3\", expected \"index1\" or", five_bar_document},
    {"/plant/baumgarte_per_s", -1.0, "plant.baumgarte_per_s", five_bar_document},
    {"/plant/spring_nm_rad", "stiff", "plant.spring_nm_rad", five_bar_document},
    {"/plant/spring_rest_rad", Json::array({0.1}), "plant.spring_rest_rad", five_bar_document},
    {"/plant/active/length_m", 0.0, "plant.active.length_m", five_bar_document},
    {"/plant/active/colour", "red", "colour", five_bar_document},
    {"/plant/passive/inertia_kg_m2", 0.0005, "plant.passive.inertia_kg_m2: got 0.0005, expected >= mass_kg com_m^2",
     five_bar_document},
    {"/external_torque/0/joint", 2, "external_torque[0].joint", five_bar_document},
    {"/plant/colour", "red", "colour", spring_disc_document},
    {"/plant/mass_kg", 0.0, "plant.mass_kg", spring_disc_document},
    {"/plant/inertia_uncertainty_per_kg", -1.0, "plant.inertia_uncertainty_per_kg", spring_disc_document},
    {"/initial/angle_rad", Json::array({0.1, 0.2}), "initial.angle_rad", spring_disc_document},
};

INSTANTIATE_TEST_SUITE_P(OneRuleAtATime, BrokenScenario, ::testing::ValuesIn(kBrokenRules));

TEST(Scenario, when_optional_members_are_absent_or_null_expect_no_filter_and_no_limit) {
  Json document = valid_document();
  const auto read = [&document] { return Scenario::parse(document.dump(), "swing.json"); };
  EXPECT_EQ(read().sensors.velocity_filter_time_constant_s, 0.0);
  EXPECT_FALSE(read().torque_limit_nm);
  document["torque_limit_nm"] = nullptr;
  EXPECT_FALSE(read().torque_limit_nm);
  document["torque_limit_nm"] = {20.0, 10.0};
  document["sensors"]["velocity_filter_time_constant_s"] = 2e-3;
  EXPECT_EQ(read().torque_limit_nm, (JointArray{20.0, 10.0}));
  EXPECT_EQ(read().sensors.velocity_filter_time_constant_s, 2e-3);
}

TEST(Scenario, when_any_member_is_missing_expect_refusal_naming_it) {
  for (const Json& complete : {valid_document(), five_bar_document(), spring_disc_document()}) {
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
}

TEST(Scenario, when_a_key_is_given_twice_expect_refusal) {
  std::string text = valid_document().dump();
  text.insert(1, R"("name": "other", )");
  EXPECT_THROW(Scenario::parse(text, "swing.json"), InputError);
}

TEST(Scenario, when_it_begins_with_a_byte_order_mark_expect_refusal) {
  EXPECT_THROW(Scenario::parse("\xEF\xBB\xBF" + valid_document().dump(), "swing.json"), InputError);
}

TEST(Scenario, when_the_file_is_missing_expect_an_input_error) {
  EXPECT_THROW(Scenario::load("/nonexistent/scenario.json"), InputError);
}

}  // namespace
}  // namespace quasilpv
