#include "quasilpv/scenario.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <utility>

#include "document/document.hpp"
#include "plants/registry.hpp"
#include "run/integrator_field.hpp"

namespace quasilpv {
namespace {

constexpr int kMaxEncoderBits = 32;
constexpr std::int64_t kMaxSeed = 9007199254740991;  // 2^53 - 1, the largest integer every JSON reader keeps
constexpr std::size_t kMaxSines = 1000;
constexpr double kLargestNumber = 1e16;
constexpr double kMaxDurationS = 86400.0;
constexpr double kMaxDelayS = 10.0;

void require_bounded(const Field& field) {
  const Json& value = field.json();
  if (value.is_number() && !(std::abs(value.get<double>()) <= kLargestNumber)) {
    field.fail(value.dump(), "a number of at most 1e16 in magnitude");
  }
  if (value.is_object()) {
    for (const auto& [key, member] : value.items()) {
      require_bounded(field[key]);
    }
  }
  for (std::size_t i = 0; value.is_array() && i < value.size(); ++i) {
    require_bounded(field.at(i));
  }
}

JointArray joint_array(const Field& field, int joints) {
  const std::vector<double> values = field.numbers(static_cast<std::size_t>(joints));
  JointArray array{};
  std::copy(values.begin(), values.end(), array.begin());
  return array;
}

std::vector<SineTorque> external_torque(const Field& field, int joints) {
  if (field.size() > kMaxSines) {
    field.fail(std::to_string(field.size()) + " terms", "at most " + std::to_string(kMaxSines));
  }
  std::vector<SineTorque> terms;
  for (std::size_t i = 0; i < field.size(); ++i) {
    const Field term = field.at(i);
    term.only({"joint", "amplitude_nm", "frequency_rad_s", "phase_rad"});
    terms.push_back({static_cast<int>(term["joint"].integer(0, joints - 1)), term["amplitude_nm"].number(),
                     term["frequency_rad_s"].number(), term["phase_rad"].number()});
  }
  return terms;
}

SensorOptions sensors(const Field& field) {
  field.only({"encoder_bits", "velocity_noise_rad_s", "seed", "velocity_filter_time_constant_s", "link_encoder_bits"});
  SensorOptions options;
  options.encoder_bits = static_cast<int>(field["encoder_bits"].integer(0, kMaxEncoderBits));
  options.velocity_noise_rad_s = field["velocity_noise_rad_s"].non_negative();
  options.seed = static_cast<std::uint64_t>(field["seed"].integer(0, kMaxSeed));
  if (field.has("velocity_filter_time_constant_s")) {
    options.velocity_filter_time_constant_s = field["velocity_filter_time_constant_s"].non_negative();
  }
  if (field.has("link_encoder_bits") && !field["link_encoder_bits"].is_null()) {
    options.link_encoder_bits = static_cast<int>(field["link_encoder_bits"].integer(0, kMaxEncoderBits));
  }
  return options;
}

std::optional<JointArray> torque_limit(const Field& root, int joints) {
  if (!root.has("torque_limit_nm") || root["torque_limit_nm"].is_null()) {
    return std::nullopt;
  }
  const Field field = root["torque_limit_nm"];
  const JointArray limit = joint_array(field, joints);
  for (std::size_t j = 0; j < field.size(); ++j) {
    static_cast<void>(field.at(j).positive());
  }
  return limit;
}

}  // namespace

Scenario Scenario::load(const std::string& path) { return parse(read_file(path), path); }

Scenario Scenario::parse(std::string_view bytes, const std::string& source) {
  const Json document = parse_strict_json(bytes, source);
  const Field root(document, source, "");
  root.only({"schema", "schema_version", "name", "duration_s", "plant", "integrator", "external_torque", "sensors",
             "transport_delay_s", "torque_limit_nm", "initial"});
  root["schema"].expect_text("quasilpv.scenario");
  static_cast<void>(root["schema_version"].integer(1, 1));
  require_bounded(root);
  Scenario scenario;
  scenario.name = root["name"].text();
  if (scenario.name.empty()) {
    root["name"].fail("an empty name", "a name");
  }
  scenario.duration_s = at_most(kMaxDurationS, root["duration_s"], root["duration_s"].positive());
  scenario.plant = read_plant(root["plant"]);
  const int n = scenario.joints();
  scenario.integrator = read_integrator(root["integrator"]);
  scenario.external_torque = quasilpv::external_torque(root["external_torque"], n);
  scenario.sensors = quasilpv::sensors(root["sensors"]);
  scenario.transport_delay_s = at_most(kMaxDelayS, root["transport_delay_s"], root["transport_delay_s"].non_negative());
  scenario.torque_limit_nm = torque_limit(root, n);
  const Field initial = root["initial"];
  initial.only({"angle_rad", "speed_rad_s"});
  scenario.initial_angle = joint_array(initial["angle_rad"], n);
  scenario.initial_speed = joint_array(initial["speed_rad_s"], n);
  return scenario;
}

int Scenario::joints() const { return plant()->joints(); }

std::unique_ptr<Plant> Scenario::make_plant() const {
  std::unique_ptr<Plant> made = plant();
  made->set_external_torque(ExternalTorque(external_torque));
  return made;
}

}  // namespace quasilpv
