#include "quasilpv/system_scenario.hpp"

#include <nlohmann/json.hpp>

#include "document/document.hpp"
#include "run/integrator_field.hpp"

namespace quasilpv {
namespace {

constexpr std::int64_t kMaxSeed = 9007199254740991;  // 2^53 - 1, the largest integer every JSON reader keeps
constexpr std::int64_t kMaxSamples = 10000000;

/// One number per signal, under its name.
std::vector<double> by_name(const Field& field, const std::vector<SystemSignal>& signals) {
  std::vector<std::string> names;
  std::vector<double> values;
  for (const SystemSignal& signal : signals) {
    names.push_back(signal.name);
    values.push_back(field[signal.name].number());
  }
  field.only(names);
  return values;
}

/// The same of numbers that are not negative.
std::vector<double> sizes_by_name(const Field& field, const std::vector<SystemSignal>& signals) {
  for (const SystemSignal& signal : signals) {
    static_cast<void>(field[signal.name].non_negative());
  }
  return by_name(field, signals);
}

}  // namespace

SystemScenario SystemScenario::load(const std::string& path, const SystemArtifact& artifact) {
  return parse(read_file(path), path, artifact);
}

SystemScenario SystemScenario::parse(std::string_view bytes, const std::string& source,
                                     const SystemArtifact& artifact) {
  const Json document = parse_strict_json(bytes, source);
  const Field root(document, source, "");
  root.only({"schema", "schema_version", "name", "samples", "start", "parameters", "integrator", "delay_s", "sensors"});
  root["schema"].expect_text("quasilpv.system_scenario");
  static_cast<void>(root["schema_version"].integer(1, 1));
  SystemScenario scenario;
  scenario.name = root["name"].text();
  scenario.samples = root["samples"].integer(1, kMaxSamples);
  scenario.start = by_name(root["start"], artifact.states());
  scenario.parameter = by_name(root["parameters"], artifact.parameters());
  scenario.integrator = read_integrator(root["integrator"]);
  scenario.delay_s = at_most(artifact.sample_period_s(), root["delay_s"], root["delay_s"].non_negative());
  const Field sensors = root["sensors"];
  sensors.only({"noise", "quantum", "seed"});
  scenario.sensors.noise = sizes_by_name(sensors["noise"], artifact.states());
  scenario.sensors.quantum = sizes_by_name(sensors["quantum"], artifact.states());
  scenario.sensors.seed = static_cast<std::uint64_t>(sensors["seed"].integer(0, kMaxSeed));
  return scenario;
}

}  // namespace quasilpv
