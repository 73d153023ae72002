#include "quasilpv/artifact.hpp"

#include <nlohmann/json.hpp>

#include "artifact/matrices.hpp"
#include "document/document.hpp"
#include "laws/registry.hpp"

namespace quasilpv {
namespace {

constexpr double kShortestPeriodS = 1e-6;
constexpr double kLongestPeriodS = 10.0;

void expect_object_or_null(const Field& field) {
  if (!field.json().is_object() && !field.is_null()) {
    field.fail("another type", "an object or null");
  }
}

void expect_object(const Field& field) {
  if (!field.json().is_object()) {
    field.fail("another type", "an object");
  }
}

std::string hex_digits(const Field& field, std::size_t count) {
  std::string text = field.text();
  const bool is_hex = text.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (text.size() != count || !is_hex) {
    field.fail(std::to_string(text.size()) + " characters", std::to_string(count) + " lower-case hexadecimal digits");
  }
  return text;
}

}  // namespace

Artifact Artifact::load(const std::string& path) { return parse(read_file(path), path); }

Artifact Artifact::parse(std::string_view bytes, const std::string& source) {
  const Json document = parse_document(bytes, source);
  const Field root(document, source, "");
  Artifact artifact;
  artifact.parse_header(root);
  artifact.parse_limits(root);
  artifact.law_kind_ = root["law"]["kind"].text();
  artifact.law_ = read_law(root["law"], root["programs"], artifact.joints_);
  return artifact;
}

void Artifact::parse_header(const Field& root) {
  root["schema"].expect_text("quasilpv.artifact");
  root["schema_version"].integer(1, 2);
  root.only({"schema", "schema_version", "hash", "name", "creator", "design_hash", "units", "sample_period_s", "joints",
             "robot", "payloads", "domain", "limits", "programs", "law", "witness", "verification"});
  hash_ = root["hash"].text();
  hash_prefix_ = static_cast<std::int64_t>(std::stoull(hash_.substr(0, 16), nullptr, 16));
  name_ = root["name"].text();
  const Field creator = root["creator"];
  creator.only({"tool", "version"});
  (void)creator["tool"].text();
  (void)creator["version"].text();
  design_hash_ = hex_digits(root["design_hash"], 64);
  root["units"].expect_text("SI");
  sample_period_s_ = root["sample_period_s"].positive(kShortestPeriodS, kLongestPeriodS);
  joints_ = static_cast<int>(root["joints"].integer(1, kMaxJoints));
  const Field robot = root["robot"];
  robot.only({"id", "parameters"});
  robot_id_ = robot["id"].text();
  expect_object(robot["parameters"]);
  expect_object(root["payloads"]);
  expect_object_or_null(root["witness"]);
  expect_object_or_null(root["verification"]);
}

void Artifact::parse_limits(const Field& root) {
  const Field domain = root["domain"];
  domain.only({"angle_rad", "speed_rad_s"});
  domain_.angle_rad = read_intervals(domain["angle_rad"], joints_);
  domain_.speed_rad_s = read_intervals(domain["speed_rad_s"], joints_);
  const Field limits = root["limits"];
  limits.only({"torque_nm", "slew_nm_per_s"});
  const auto torque = [](const Field& field) { return field.positive(1.0 / kLargestTorqueNm, kLargestTorqueNm); };
  limits_.torque_nm = read_joint_values(limits["torque_nm"], joints_, torque);
  limits_.slew_nm_per_s =
      read_joint_values(limits["slew_nm_per_s"], joints_, [](const Field& field) { return field.positive(); });
}

}  // namespace quasilpv
