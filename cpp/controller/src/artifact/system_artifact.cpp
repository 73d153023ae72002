#include "quasilpv/system_artifact.hpp"

#include <Eigen/Cholesky>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "document/document.hpp"

namespace quasilpv {
namespace {

constexpr const char* kSchema = "quasilpv.system_artifact";
constexpr double kShortestPeriodS = 1e-6;
constexpr double kLongestPeriodS = 10.0;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

SystemSignal parse_signal(const Field& field) {
  field.only({"name", "role", "unit", "low", "high", "trim", "known"});
  SystemSignal signal;
  signal.name = field["name"].text();
  (void)field["unit"].text();
  signal.low = field["low"].is_null() ? -kInfinity : field["low"].number();
  signal.high = field["high"].is_null() ? kInfinity : field["high"].number();
  if (signal.low > signal.high) {
    field["high"].fail(canonical_number(signal.high), "at least low");
  }
  signal.trim = field["trim"].number();
  signal.known = field["known"].boolean();
  return signal;
}

AffineMatrix parse_affine(const Field& field, int premises, int rows, int columns) {
  field.only({"constant", "coefficients"});
  AffineMatrix matrix;
  matrix.constant = parse_matrix(field["constant"], rows, columns);
  const Field slopes = field["coefficients"];
  if (slopes.size() != static_cast<std::size_t>(premises)) {
    slopes.fail("an array of " + std::to_string(slopes.size()), std::to_string(premises));
  }
  for (std::size_t p = 0; p < slopes.size(); ++p) {
    matrix.slopes.push_back(parse_matrix(slopes.at(p), rows, columns));
  }
  return matrix;
}

}  // namespace

SystemArtifact SystemArtifact::load(const std::string& path) { return parse(read_file(path), path); }

bool SystemArtifact::is_in(const std::string& path) {
  const Json document = parse_document(read_file(path), path);
  return document.contains("schema") && document["schema"] == kSchema;
}

SystemArtifact SystemArtifact::parse(std::string_view bytes, const std::string& source) {
  const Json document = parse_document(bytes, source);
  const Field root(document, source, "");
  root["schema"].expect_text(kSchema);
  const bool is_second = root["schema_version"].integer(1, 2) > 1;
  std::vector<std::string> members = {"schema",      "schema_version",  "hash",    "name",     "creator",
                                      "design_hash", "sample_period_s", "signals", "model",    "law",
                                      "region",      "plant",           "witness", "sampling", "verification"};
  if (is_second) {
    members.emplace_back("observer");
  }
  root.only(members);
  SystemArtifact artifact;
  artifact.hash_ = root["hash"].text();
  artifact.hash_prefix_ = static_cast<std::int64_t>(std::stoull(artifact.hash_.substr(0, 16), nullptr, 16));
  artifact.name_ = root["name"].text();
  artifact.sample_period_s_ = root["sample_period_s"].positive(kShortestPeriodS, kLongestPeriodS);
  artifact.parse_signals(root["signals"]);
  const int states = static_cast<int>(artifact.states_.size());
  artifact.differential_ = static_cast<int>(root["model"]["differential"].integer(1, states));
  const Field law = root["law"];
  law.only(is_second ? std::vector<std::string>{"kind", "gain", "schedule", "premise_fault_s"}
                     : std::vector<std::string>{"kind", "gain", "schedule"});
  if (is_second) {
    const Field policy = law["premise_fault_s"];
    artifact.premise_fault_s_ = policy.is_null() ? kInfinity : policy.non_negative();
  }
  law["kind"].expect_text("regional-feedback");
  artifact.gain_ = BlockPolytope::parse(law["gain"], static_cast<int>(artifact.inputs_.size()), artifact.differential_);
  ProgramScope scope;
  scope.signals = artifact.signals();
  artifact.schedule_ = Program::parse(law["schedule"], scope, artifact.gain_.premises());
  const Field region = root["region"];
  region.only({"lyapunov", "decay_rate_per_s", "speed_per_s"});
  const Eigen::MatrixXd lyapunov = parse_matrix(region["lyapunov"], artifact.differential_, artifact.differential_);
  const Eigen::LLT<Eigen::MatrixXd> factors(lyapunov);
  if (factors.info() != Eigen::Success) {
    region["lyapunov"].fail("another matrix", "a positive definite matrix");
  }
  artifact.lyapunov_inverse_ = factors.solve(Eigen::MatrixXd::Identity(artifact.differential_, artifact.differential_));
  if (is_second && !root["observer"].is_null()) {
    artifact.parse_observer(root["observer"], root["model"]);
  }
  artifact.parse_plant(root["plant"]);
  return artifact;
}

void SystemArtifact::parse_observer(const Field& field, const Field& model) {
  field.only({"measured", "gain", "lyapunov", "weight", "start"});
  const int states = static_cast<int>(states_.size());
  SystemObserverParameters own;
  own.E = parse_affine(model["E"], gain_.premises(), states, states);
  own.A = parse_affine(model["A"], gain_.premises(), states, states);
  own.B = parse_affine(model["B"], gain_.premises(), states, static_cast<int>(inputs_.size()));
  own.is_measured.assign(states_.size(), false);
  const Field names = field["measured"];
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string name = names.at(i).text();
    int k = own.measured.empty() ? 0 : own.measured.back() + 1;
    while (k < differential_ && states_[static_cast<std::size_t>(k)].name != name) {
      ++k;
    }
    if (k >= differential_) {
      names.at(i).fail("\"" + name + "\"", "a differential state, in the order of the signals");
    }
    own.measured.push_back(k);
    own.is_measured[static_cast<std::size_t>(k)] = true;
  }
  const int measured = static_cast<int>(own.measured.size());
  if (measured == 0 || measured == differential_) {
    names.fail(std::to_string(measured) + " names", "1 to " + std::to_string(differential_ - 1));
  }
  own.gain = parse_matrix(field["gain"], differential_, measured);
  const std::vector<double> start = field["start"].numbers(static_cast<std::size_t>(differential_));
  own.start = Eigen::Map<const Eigen::VectorXd>(start.data(), differential_);
  observer_ = std::move(own);
}

void SystemArtifact::parse_signals(const Field& field) {
  if (field.size() == 0 || field.size() > static_cast<std::size_t>(kMaxSignals)) {
    field.fail("an array of " + std::to_string(field.size()), "1 to " + std::to_string(kMaxSignals) + " signals");
  }
  for (std::size_t k = 0; k < field.size(); ++k) {
    const Field role = field.at(k)["role"];
    const std::string name = role.text();
    const bool late =
        (name == "state" && !(inputs_.empty() && parameters_.empty())) || (name == "input" && !parameters_.empty());
    if (late) {
      role.fail("\"" + name + "\"", "states first, then inputs, then parameters");
    }
    if (name == "state") {
      states_.push_back(parse_signal(field.at(k)));
    } else if (name == "input") {
      inputs_.push_back(parse_signal(field.at(k)));
    } else if (name == "parameter") {
      parameters_.push_back(parse_signal(field.at(k)));
    } else {
      role.fail_choice({"state", "input", "parameter"});
    }
  }
  const auto require = [&](std::size_t count, int most, const char* what) {
    if (count == 0 || count > static_cast<std::size_t>(most)) {
      field.fail(std::to_string(count) + " " + what, "1 to " + std::to_string(most));
    }
  };
  require(states_.size(), kMaxStates, "states");
  require(inputs_.size(), kMaxInputs, "inputs");
}

void SystemArtifact::parse_plant(const Field& field) {
  field.only({"residual", "jacobian"});
  const int states = static_cast<int>(states_.size());
  ProgramScope scope;
  scope.signals = signals() + states;
  residual_ = Program::parse(field["residual"], scope, states);
  const Field rows = field["jacobian"];
  if (rows.size() != states_.size()) {
    rows.fail("an array of " + std::to_string(rows.size()), std::to_string(states) + " rows");
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    jacobian_.push_back(Program::parse(rows.at(i), scope, 2 * states));
  }
}

}  // namespace quasilpv
