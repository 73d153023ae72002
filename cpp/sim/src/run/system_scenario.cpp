#include "quasilpv/system_scenario.hpp"

#include <nlohmann/json.hpp>

#include "document/document.hpp"
#include "run/integrator_field.hpp"

namespace quasilpv {
namespace {

constexpr std::int64_t kMaxSeed = 9007199254740991;  // 2^53 - 1, the largest integer every JSON reader keeps
constexpr std::int64_t kMaxSamples = 10000000;
constexpr std::size_t kMaxTerms = 1000;

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

/// The place of a signal that can be disturbed: a differential state or an input.
std::size_t disturbed(const Field& field, const SystemArtifact& artifact) {
  const std::string name = field.text();
  std::vector<std::string> names;
  for (int k = 0; k < artifact.differential(); ++k) {
    names.push_back(artifact.states()[static_cast<std::size_t>(k)].name);
    if (names.back() == name) {
      return static_cast<std::size_t>(k);
    }
  }
  for (std::size_t k = 0; k < artifact.inputs().size(); ++k) {
    names.push_back(artifact.inputs()[k].name);
    if (names.back() == name) {
      return artifact.states().size() + k;
    }
  }
  field.fail_choice(names);
}

DisturbanceTerm disturbance(const Field& field, const SystemArtifact& artifact) {
  const std::string kind = field["kind"].text();
  std::vector<std::string> members = {"kind", "signal", "begin_s", "end_s"};
  DisturbanceTerm term;
  if (kind == "constant") {
    members.emplace_back("value");
    term.size = field["value"].number();
  } else if (kind == "sine") {
    members.insert(members.end(), {"amplitude", "frequency_rad_s", "phase_rad"});
    term.kind = DisturbanceTerm::Kind::kSine;
    term.size = field["amplitude"].number();
    term.frequency_rad_s = field["frequency_rad_s"].number();
    term.phase_rad = field["phase_rad"].number();
  } else if (kind == "noise") {
    members.insert(members.end(), {"deviation", "seed"});
    term.kind = DisturbanceTerm::Kind::kNoise;
    term.size = field["deviation"].non_negative();
    term.seed = static_cast<std::uint64_t>(field["seed"].integer(0, kMaxSeed));
  } else {
    field["kind"].fail_choice({"constant", "sine", "noise"});
  }
  field.only(members);
  term.signal = disturbed(field["signal"], artifact);
  term.begin_s = field["begin_s"].non_negative();
  if (!field["end_s"].is_null()) {
    term.end_s = field["end_s"].non_negative();
  }
  return term;
}

std::vector<DisturbanceTerm> disturbances(const Field& field, const SystemArtifact& artifact) {
  if (field.size() > kMaxTerms) {
    field.fail(std::to_string(field.size()) + " terms", "at most " + std::to_string(kMaxTerms));
  }
  std::vector<DisturbanceTerm> terms;
  terms.reserve(field.size());
  for (std::size_t i = 0; i < field.size(); ++i) {
    terms.push_back(disturbance(field.at(i), artifact));
  }
  return terms;
}

}  // namespace

SystemScenario SystemScenario::load(const std::string& path, const SystemArtifact& artifact) {
  return parse(read_file(path), path, artifact);
}

SystemScenario SystemScenario::parse(std::string_view bytes, const std::string& source,
                                     const SystemArtifact& artifact) {
  const Json document = parse_strict_json(bytes, source);
  const Field root(document, source, "");
  root.only({"schema", "schema_version", "name", "samples", "start", "parameters", "integrator", "delay_s", "sensors",
             "disturbances"});
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
  if (root.has("disturbances")) {
    scenario.disturbances = quasilpv::disturbances(root["disturbances"], artifact);
  }
  return scenario;
}

}  // namespace quasilpv
