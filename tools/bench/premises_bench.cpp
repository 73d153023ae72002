// premises_bench PREMISES dense|collapsed STEPS ROUNDS: duration of the control step of a torque-level law with seven
// joints against its number of premises. Collapsed: one block per premise. Dense: one block of all, 2^p vertices.
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "document/document.hpp"
#include "main.hpp"
#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

constexpr int kJoints = kMaxJoints;
constexpr int kSquares = kJoints * kJoints;

/// Numbers of few digits: a dense table of 12 premises is a document of 1.6 million.
class Numbers {
 public:
  double operator()(double low, double high) {
    constexpr double kDigits = 1e3;
    return std::round(kDigits * std::uniform_real_distribution<double>(low, high)(generator_)) / kDigits;
  }

 private:
  std::mt19937_64 generator_{1};
};

/// Blocks of n x n matrices d I, one below or beside the other, each entry perturbed (symmetrically) by up to `spread`.
Json vertex(const std::vector<double>& diagonals, bool below, double spread, Numbers& numbers) {
  const std::size_t blocks = diagonals.size();
  std::vector<std::vector<double>> rows((below ? blocks : 1) * kJoints,
                                        std::vector<double>((below ? 1 : blocks) * kJoints));
  for (std::size_t block = 0; block < blocks; ++block) {
    for (int entry = 0; entry < kSquares; ++entry) {
      const int i = entry / kJoints;
      const int j = entry % kJoints;
      const std::size_t row = i + (below ? block * kJoints : 0);
      const std::size_t column = j + (below ? 0 : block * kJoints);
      const double mirrored = i > j ? rows[row - i + j][column - j + i] : numbers(-spread, spread);
      rows[row][column] = mirrored + (i == j ? diagonals[block] : 0.0);
    }
  }
  return rows;
}

Json table(int premises, bool dense, const std::vector<double>& diagonals, bool below, double spread,
           Numbers& numbers) {
  Json blocks = Json::array();
  std::vector<std::vector<int>> partition(dense ? 1 : static_cast<std::size_t>(premises));
  for (int p = 0; p < premises; ++p) {
    partition[dense ? 0 : static_cast<std::size_t>(p)].push_back(p);
  }
  for (const std::vector<int>& group : partition) {
    Json vertices = Json::array();
    for (std::size_t corner = 0; corner < std::size_t{1} << group.size(); ++corner) {
      vertices.push_back(vertex(diagonals, below, spread, numbers));
    }
    blocks.push_back({{"kind", "box"}, {"premises", group}, {"vertices", std::move(vertices)}});
  }
  const std::vector<double> one(static_cast<std::size_t>(premises), 1.0);
  const std::vector<double> minus_one(static_cast<std::size_t>(premises), -1.0);
  const std::vector<double> zero(static_cast<std::size_t>(premises), 0.0);
  return {{"premises", premises}, {"lower", minus_one}, {"upper", one}, {"centre", zero}, {"blocks", blocks}};
}

/// cos(y_j), then sin(y_j), then cos(y_j + y_{j+1}): what the premises of arms are made of.
Json premise_program(int premises) {
  Json code = Json::array();
  for (int p = 0; p < premises; ++p) {
    const int joint = p % kJoints;
    code.push_back({"angle", joint});
    if (p / kJoints == 2) {
      code.push_back({"angle", (joint + 1) % kJoints});
      code.push_back(Json::array({"add"}));
    }
    code.push_back(Json::array({p / kJoints == 1 ? "sin" : "cos"}));
  }
  return {{"outputs", premises}, {"code", code}};
}

Json gravity_program() {
  Json code = Json::array();
  for (int j = 0; j < kJoints; ++j) {
    code.insert(code.end(), {{"angle", j}, Json::array({"sin"})});
  }
  return {{"outputs", kJoints}, {"code", code}};
}

Artifact torque_law(int premises, bool dense) {
  Numbers numbers;
  const auto interval = Json(std::vector<Json>(kJoints, Json::array({-2.0, 2.0})));
  Json document = {
      {"schema", "quasilpv.artifact"},
      {"schema_version", 1},
      {"name", "premises-bench"},
      {"creator", {{"tool", "premises_bench"}, {"version", "1"}}},
      {"design_hash", std::string(64, '0')},
      {"units", "SI"},
      {"sample_period_s", 1e-3},
      {"joints", kJoints},
      {"robot", {{"id", "none"}, {"parameters", {{"gravity_m_s2", 9.81}}}}},
      {"payloads", Json::object()},
      {"domain", {{"angle_rad", interval}, {"speed_rad_s", interval}}},
      {"limits",
       {{"torque_nm", std::vector<double>(kJoints, 1e4)}, {"slew_nm_per_s", std::vector<double>(kJoints, 1e7)}}},
      {"programs", {{"premises", premise_program(premises)}, {"gravity", gravity_program()}}},
      {"law",
       {{"kind", "dob-torque"},
        {"inertia", table(premises, dense, {10.0}, false, 0.5, numbers)},
        {"feedback", table(premises, dense, {-4800.0, -120.0, -64000.0}, false, 5.0, numbers)},
        {"observer", table(premises, dense, {900.0, 3e5, 4e7, 2e9}, true, 50.0, numbers)},
        {"filter_time_constant_s", 1e-3}}},
      {"witness", nullptr},
      {"verification", Json::object()}};
  document["hash"] = sha256_hex(canonical_json(document));
  return Artifact::parse(canonical_json(document), "premises_bench");
}

/// A slow swing around the middle: the observer must not run away from a law that nobody closes.
StepInput input_of(std::int64_t k) {
  StepInput input;
  input.seq = k;
  for (std::size_t j = 0; j < kJoints; ++j) {
    input.angle[j] = 0.5 * std::sin(1e-3 * static_cast<double>(k) + static_cast<double>(j));
  }
  input.reference.angle = input.angle;
  return input;
}

Json measure(const std::vector<std::string>& arguments) {
  const int premises = count(arguments[0]);
  const bool dense = arguments[1] == "dense";
  const auto steps = static_cast<std::size_t>(count(arguments[2]));
  const Artifact artifact = torque_law(premises, dense);
  std::vector<StepInput> inputs;
  for (std::size_t k = 0; k < steps; ++k) {
    inputs.push_back(input_of(static_cast<std::int64_t>(k)));
  }
  Controller controller(artifact);
  const Timing timing = time_calls(
      steps, count(arguments[3]), [&] { controller.reset(); },
      [&](std::size_t i) { keep(controller.step(inputs[i])); });
  controller.reset();
  for (const StepInput& input : inputs) {
    if ((controller.step(input).flags & (kTorqueNotFinite | kModelInvalid)) != 0) {
      throw std::runtime_error("the law that is timed left the numbers at sample " + std::to_string(input.seq));
    }
  }
  const int vertices = artifact.law().model.inertia.vertices();  // the gains have as many
  return {{"premises", premises}, {"vertices", vertices}, {"timing", to_json(timing)}};
}

}  // namespace

int main(int argc, char** argv) {
  return run_benchmark(argc, argv, {"PREMISES", "dense|collapsed", "STEPS", "ROUNDS"}, measure);
}
