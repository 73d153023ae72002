#include "quasilpv/artifact.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "quasilpv/document.hpp"

namespace quasilpv {
namespace {

constexpr double kShortestPeriodS = 1e-6;
constexpr double kLongestPeriodS = 10.0;
constexpr double kSymmetryTolerance = 1e-12;      // relative to the largest entry
constexpr double kDefinitenessTolerance = 1e-12;  // smallest over largest eigenvalue

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

double any_number(const Field& field) { return field.number(); }

template <class Read>
JointArray joint_values(const Field& field, int joints, Read read) {
  if (field.size() != static_cast<std::size_t>(joints)) {
    field.fail("an array of " + std::to_string(field.size()), std::to_string(joints) + " values, one per joint");
  }
  JointArray values{};
  for (std::size_t j = 0; j < field.size(); ++j) {
    values[j] = read(field.at(j));
  }
  return values;
}

std::array<Interval, kMaxJoints> intervals(const Field& field, int joints) {
  if (field.size() != static_cast<std::size_t>(joints)) {
    field.fail("an array of " + std::to_string(field.size()), std::to_string(joints) + " intervals, one per joint");
  }
  std::array<Interval, kMaxJoints> result{};
  for (std::size_t j = 0; j < field.size(); ++j) {
    const std::vector<double> bounds = field.at(j).numbers(2);
    if (bounds[0] >= bounds[1]) {
      field.at(j).fail("[" + canonical_number(bounds[0]) + ", " + canonical_number(bounds[1]) + "]",
                       "a lower bound below the upper bound");
    }
    result[j] = {bounds[0], bounds[1]};
  }
  return result;
}

void require_symmetric(const Field& field, const std::string& name, const Eigen::MatrixXd& matrix,
                       const std::string& expected) {
  const double asymmetry = (matrix - matrix.transpose()).cwiseAbs().maxCoeff();
  if (!(asymmetry <= kSymmetryTolerance * matrix.cwiseAbs().maxCoeff())) {
    field.fail(name + " with asymmetry " + Json(asymmetry).dump(), expected);
  }
}

void require_positive_definite(const Field& field, const std::string& where, const Eigen::MatrixXd& matrix,
                               const std::string& expected) {
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
  const double smallest = eigenvalues.minCoeff();
  if (!(smallest > kDefinitenessTolerance * eigenvalues.cwiseAbs().maxCoeff())) {
    field.fail("smallest eigenvalue " + Json(smallest).dump() + where, expected);
  }
}

// Only the centre is tested for definiteness: premises depend on each other, so a corner of the box need not be a
// configuration of the robot, and the design inertia may rightly be indefinite there.
BlockPolytope parse_inertia(const Field& field, int joints) {
  BlockPolytope inertia = BlockPolytope::parse(field, joints, joints);
  for (int i = 0; i < inertia.vertices(); ++i) {
    require_symmetric(field["blocks"], "vertex " + std::to_string(i), inertia.vertex(i), "symmetric vertices");
  }
  require_positive_definite(field, " at the centre of the box", inertia.at_centre(), "a positive definite inertia");
  return inertia;
}

DesignModel parse_model(const Field& law, const Field& programs, int joints) {
  BlockPolytope inertia = parse_inertia(law["inertia"], joints);
  const ProgramScope scope{joints, false, false};
  Program premises = Program::parse(programs["premises"], scope, inertia.premises());
  Program gravity = Program::parse(programs["gravity"], scope, joints);
  return {std::move(premises), std::move(inertia), std::move(gravity)};
}

Eigen::MatrixXd parse_lyapunov(const Field& field, int size) {
  Eigen::MatrixXd lyapunov = parse_matrix(field, size, size);
  require_symmetric(field, "a matrix", lyapunov, "a symmetric matrix");
  require_positive_definite(field, "", lyapunov, "a positive definite matrix");
  return lyapunov;
}

// The innovation is read off the corrected estimate, y - th = (1 - l1) (y - predicted angle).
LyapunovBound parse_lyapunov_bound(const Field& law, int joints) {
  const Field bound = law["lyapunov_bound"];
  bound.only({"signals", "joints"});
  if (law["observer"].at(0).number() == 1.0) {
    law["observer"].at(0).fail("1", "another number with law.lyapunov_bound");
  }
  LyapunovBound parsed{parse_lyapunov(bound["signals"], LyapunovBound::kSignals),
                       Eigen::Matrix<double, kMaxJoints, kMaxJoints>::Zero()};
  parsed.joints.topLeftCorner(joints, joints) = parse_lyapunov(bound["joints"], joints);
  return parsed;
}

DobAccelerationParameters parse_dob_acceleration(const Field& law, const Field& programs, int joints) {
  programs.only({"premises", "gravity"});
  law.only({"kind", "feedback", "observer", "filter_time_constant_s", "disturbance_compensation", "inertia",
            "lyapunov_bound"});
  const Field feedback = law["feedback"];
  feedback.only({"kp", "kd", "ki"});
  DobAccelerationParameters parameters{parse_model(law, programs, joints)};
  parameters.kp = feedback["kp"].number();
  parameters.kd = feedback["kd"].number();
  parameters.ki = feedback["ki"].number();
  const std::vector<double> observer = law["observer"].numbers(parameters.observer.size());
  std::copy(observer.begin(), observer.end(), parameters.observer.begin());
  parameters.filter_time_constant_s = law["filter_time_constant_s"].positive();
  parameters.disturbance_compensation = law["disturbance_compensation"].boolean();
  if (law.has("lyapunov_bound")) {
    parameters.lyapunov_bound = parse_lyapunov_bound(law, joints);
  }
  return parameters;
}

BlockPolytope parse_gains(const Field& field, const BlockPolytope& inertia, int rows, int columns) {
  BlockPolytope gains = BlockPolytope::parse(field, rows, columns);
  if (!gains.is_scheduled_like(inertia)) {
    field.fail("another box, centre or partition of the premises", "that of law.inertia");
  }
  return gains;
}

DobTorqueParameters parse_dob_torque(const Field& law, const Field& programs, int joints) {
  programs.only({"premises", "gravity"});
  law.only({"kind", "feedback", "observer", "filter_time_constant_s", "inertia", "premultiplication"});
  DesignModel model = parse_model(law, programs, joints);
  BlockPolytope feedback = parse_gains(law["feedback"], model.inertia, joints, 3 * joints);
  BlockPolytope observer = parse_gains(law["observer"], model.inertia, 4 * joints, joints);
  std::optional<BlockPolytope> premultiplication;
  if (law.has("premultiplication")) {
    premultiplication = parse_gains(law["premultiplication"], model.inertia, joints, joints);
  }
  return {std::move(model), std::move(feedback), std::move(observer), law["filter_time_constant_s"].positive(),
          std::move(premultiplication)};
}

HinfTrackingParameters parse_hinf_tracking(const Field& law, const Field& programs, int joints) {
  programs.only({"premises", "gravity"});
  law.only({"kind", "numerator", "lyapunov", "velocity_filter_time_constant_s", "inertia"});
  DesignModel model = parse_model(law, programs, joints);
  BlockPolytope numerator = parse_gains(law["numerator"], model.inertia, joints, 3 * joints);
  return {std::move(model), std::move(numerator), parse_lyapunov(law["lyapunov"], 3 * joints),
          law["velocity_filter_time_constant_s"].non_negative()};
}

// Premises of gains: from angles and speeds, as many as the table has.
Program parse_schedule(const Field& programs, int joints, const BlockPolytope& table) {
  return Program::parse(programs["schedule"], {joints, true, false}, table.premises());
}

StateFeedbackParameters parse_state_feedback(const Field& law, const Field& programs, int joints) {
  programs.only({"premises", "gravity", "schedule"});
  law.only({"kind", "gain", "velocity_filter_time_constant_s", "inertia"});
  DesignModel model = parse_model(law, programs, joints);
  BlockPolytope gain = BlockPolytope::parse(law["gain"], joints, 2 * joints);
  Program schedule = parse_schedule(programs, joints, gain);
  return {std::move(model), std::move(schedule), std::move(gain),
          law["velocity_filter_time_constant_s"].non_negative()};
}

DescriptorFeedbackParameters parse_descriptor_feedback(const Field& law, const Field& programs, int joints) {
  programs.only({"premises", "gravity", "schedule"});
  law.only({"kind", "numerator", "lyapunov", "velocity_filter_time_constant_s", "inertia"});
  DesignModel model = parse_model(law, programs, joints);
  BlockPolytope numerator = BlockPolytope::parse(law["numerator"], joints, 2 * joints);
  Program schedule = parse_schedule(programs, joints, numerator);
  return {std::move(model), std::move(schedule), std::move(numerator), parse_lyapunov(law["lyapunov"], 2 * joints),
          law["velocity_filter_time_constant_s"].non_negative()};
}

// A window shorter than a few samples has no mean to speak of: it is 0, and the artifact says so, or long enough.
int parse_window(const Field& field) {
  const auto samples = static_cast<int>(field.integer(0, kMaxWindowSamples));
  if (samples > 0 && samples < kMinWindowSamples) {
    field.fail(std::to_string(samples),
               "0 (the limit of a short window) or at least " + std::to_string(kMinWindowSamples) + " sample periods");
  }
  return samples;
}

std::vector<Eigen::MatrixXd> parse_numerators(const Field& field, int count, int joints) {
  if (field.size() != static_cast<std::size_t>(count)) {
    field.fail(std::to_string(field.size()) + " matrices",
               std::to_string(count) + ", the cube of the number of vertices");
  }
  std::vector<Eigen::MatrixXd> numerators;
  for (std::size_t i = 0; i < field.size(); ++i) {
    numerators.push_back(parse_matrix(field.at(i), joints, 2 * joints));
  }
  return numerators;
}

DelayedFeedbackParameters parse_delayed_feedback(const Field& law, const Field& programs, int joints) {
  programs.only({"premises", "gravity", "schedule"});
  law.only(
      {"kind", "lyapunov", "numerators", "window_samples", "descriptor", "velocity_filter_time_constant_s", "inertia"});
  DesignModel model = parse_model(law, programs, joints);
  BlockPolytope lyapunov = BlockPolytope::parse(law["lyapunov"], 2 * joints, 2 * joints);
  const int count = lyapunov.vertices();
  if (count > kMaxDelayedVertices) {
    law["lyapunov"].fail(std::to_string(count) + " vertices", "at most " + std::to_string(kMaxDelayedVertices));
  }
  for (int k = 0; k < count; ++k) {
    const std::string vertex = "vertex " + std::to_string(k);
    require_symmetric(law["lyapunov"]["blocks"], vertex, lyapunov.vertex(k), "symmetric vertices");
    require_positive_definite(law["lyapunov"]["blocks"], " of " + vertex, lyapunov.vertex(k),
                              "positive definite vertices");
  }
  Program schedule = parse_schedule(programs, joints, lyapunov);
  return {std::move(model),
          std::move(schedule),
          std::move(lyapunov),
          parse_numerators(law["numerators"], count * count * count, joints),
          parse_window(law["window_samples"]),
          law["descriptor"].boolean(),
          law["velocity_filter_time_constant_s"].non_negative()};
}

PidParameters parse_pid(const Field& law, const Field& programs, int joints) {
  programs.only({"premises", "gravity", "coriolis_reference"});
  law.only({"kind", "kp", "kd", "ki", "velocity_filter_time_constant_s", "inertia"});
  PidParameters parameters{parse_model(law, programs, joints),
                           Program::parse(programs["coriolis_reference"], {joints, true, true}, joints)};
  parameters.kp = joint_values(law["kp"], joints, any_number);
  parameters.kd = joint_values(law["kd"], joints, any_number);
  parameters.ki = joint_values(law["ki"], joints, any_number);
  parameters.velocity_filter_time_constant_s = law["velocity_filter_time_constant_s"].non_negative();
  return parameters;
}

ComputedTorqueParameters parse_computed_torque(const Field& law, const Field& programs, int joints) {
  programs.only({"premises", "gravity", "coriolis"});
  law.only(
      {"kind", "gp", "gd", "gi", "velocity_filter_time_constant_s", "disturbance_observer_bandwidth_rad_s", "inertia"});
  ComputedTorqueParameters parameters{parse_model(law, programs, joints),
                                      Program::parse(programs["coriolis"], {joints, true, false}, joints)};
  parameters.gp = joint_values(law["gp"], joints, any_number);
  parameters.gd = joint_values(law["gd"], joints, any_number);
  parameters.gi = joint_values(law["gi"], joints, any_number);
  parameters.velocity_filter_time_constant_s = law["velocity_filter_time_constant_s"].non_negative();
  const Field bandwidth = law["disturbance_observer_bandwidth_rad_s"];
  parameters.disturbance_observer_bandwidth_rad_s = bandwidth.non_negative();
  const bool has_observer = parameters.disturbance_observer_bandwidth_rad_s > 0.0;
  if (has_observer != (law["kind"].text() == "ctc-dob")) {
    bandwidth.fail(canonical_number(bandwidth.number()), "0 for kind ctc, above 0 for kind ctc-dob");
  }
  return parameters;
}

}  // namespace

Artifact Artifact::load(const std::string& path) { return parse(read_file(path), path); }

Artifact Artifact::parse(std::string_view bytes, const std::string& source) {
  const Json document = parse_document(bytes, source);
  const Field root(document, source, "");
  Artifact artifact;
  artifact.parse_header(root);
  artifact.parse_limits(root);
  artifact.parse_law(root["law"], root["programs"]);
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
  domain_.angle_rad = intervals(domain["angle_rad"], joints_);
  domain_.speed_rad_s = intervals(domain["speed_rad_s"], joints_);
  const Field limits = root["limits"];
  limits.only({"torque_nm", "slew_nm_per_s"});
  const auto torque = [](const Field& field) { return field.positive(1.0 / kLargestTorqueNm, kLargestTorqueNm); };
  limits_.torque_nm = joint_values(limits["torque_nm"], joints_, torque);
  limits_.slew_nm_per_s =
      joint_values(limits["slew_nm_per_s"], joints_, [](const Field& field) { return field.positive(); });
}

void Artifact::parse_law(const Field& law, const Field& programs) {
  law_kind_ = law["kind"].text();
  if (law_kind_ == "dob-acceleration") {
    law_ = parse_dob_acceleration(law, programs, joints_);
  } else if (law_kind_ == "dob-torque") {
    law_ = parse_dob_torque(law, programs, joints_);
  } else if (law_kind_ == "hinf-tracking") {
    law_ = parse_hinf_tracking(law, programs, joints_);
  } else if (law_kind_ == "state-feedback") {
    law_ = parse_state_feedback(law, programs, joints_);
  } else if (law_kind_ == "descriptor-feedback") {
    law_ = parse_descriptor_feedback(law, programs, joints_);
  } else if (law_kind_ == "delayed-feedback") {
    law_ = parse_delayed_feedback(law, programs, joints_);
  } else if (law_kind_ == "pid") {
    law_ = parse_pid(law, programs, joints_);
  } else if (law_kind_ == "ctc" || law_kind_ == "ctc-dob") {
    law_ = parse_computed_torque(law, programs, joints_);
  } else {
    law["kind"].fail(Json(law_kind_).dump(),
                     "dob-acceleration, dob-torque, hinf-tracking, state-feedback, descriptor-feedback, "
                     "delayed-feedback, pid, ctc or ctc-dob");
  }
}

}  // namespace quasilpv
