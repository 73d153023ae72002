#include "artifact_fixture.hpp"

#include <algorithm>
#include <cmath>

namespace quasilpv::testing {

Eigen::MatrixXd TestArm::constant_inertia() const {
  Eigen::MatrixXd inertia = Eigen::MatrixXd::Constant(joints, joints, 0.1);
  for (int j = 0; j < joints; ++j) {
    inertia(j, j) = 8.0 - 0.5 * j;
  }
  return inertia;
}

Eigen::MatrixXd TestArm::inertia_slope(int premise) const {
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(joints, joints);
  const int next = (premise + 1) % joints;
  slope(premise, premise) = 1.0;
  slope(premise, next) += 0.25;
  slope(next, premise) += 0.25;
  return slope;
}

Eigen::MatrixXd TestArm::inertia_of_premises(const Eigen::VectorXd& premise) const {
  Eigen::MatrixXd inertia = constant_inertia();
  for (int p = 0; p < joints; ++p) {
    inertia += premise(p) * inertia_slope(p);
  }
  return inertia;
}

Eigen::VectorXd TestArm::premises(const Eigen::VectorXd& angle) const {
  return angle.array().cos().max(kLower).min(kUpper).matrix();
}

Eigen::MatrixXd TestArm::inertia(const Eigen::VectorXd& angle) const { return inertia_of_premises(premises(angle)); }

Eigen::VectorXd TestArm::gravity(const Eigen::VectorXd& angle) const {
  Eigen::VectorXd torque(joints);
  for (int j = 0; j < joints; ++j) {
    torque(j) = 9.81 * (j + 1) * std::sin(angle(j));
  }
  return torque;
}

Eigen::VectorXd TestArm::coriolis(const Eigen::VectorXd& angle, const Eigen::VectorXd& speed,
                                  const Eigen::VectorXd& v) const {
  Eigen::VectorXd torque(joints);
  for (int j = 0; j < joints; ++j) {
    torque(j) = 0.3 * (j + 1) * speed(j) * std::sin(angle(j)) * v(j);
  }
  return torque;
}

Json TestArm::premises_program() const {
  Json code = Json::array();
  for (int j = 0; j < joints; ++j) {
    code.insert(code.end(), {Json{"angle", j}, Json{"cos"}});
  }
  return {{"outputs", joints}, {"code", code}};
}

Json TestArm::gravity_program() const {
  Json code = Json::array();
  for (int j = 0; j < joints; ++j) {
    code.insert(code.end(), {Json{"const", 9.81 * (j + 1)}, Json{"angle", j}, Json{"sin"}, Json{"mul"}});
  }
  return {{"outputs", joints}, {"code", code}};
}

Json TestArm::coriolis_program(const std::string& factor) const {
  Json code = Json::array();
  for (int j = 0; j < joints; ++j) {
    code.insert(code.end(), {Json{"const", 0.3 * (j + 1)}, Json{"speed", j}, Json{"mul"}, Json{"angle", j}, Json{"sin"},
                             Json{"mul"}, Json{factor, j}, Json{"mul"}});
  }
  return {{"outputs", joints}, {"code", code}};
}

Json TestArm::rows(const Eigen::MatrixXd& matrix) {
  Json result = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      row.push_back(matrix(i, j));
    }
    result.push_back(row);
  }
  return result;
}

Eigen::MatrixXd TestArm::feedback(const Eigen::VectorXd& premise) const {
  Eigen::MatrixXd gain(joints, 3 * joints);
  gain << -4800.0 * inertia_of_premises(premise), -120.0 * inertia_of_premises(premise),
      -64000.0 * inertia_of_premises(premise);
  gain.array() += 3.0 * premise(0);
  return gain;
}

Eigen::MatrixXd TestArm::observer(const Eigen::VectorXd& premise) const {
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(joints, joints);
  Eigen::MatrixXd gain(4 * joints, joints);
  gain << 2400.0 * one, 2.0e6 * one, 8.0e8 * inertia_of_premises(premise), 1.0e11 * inertia_of_premises(premise);
  gain.array() += 40.0 * premise(joints - 1);
  return gain;
}

Eigen::MatrixXd TestArm::numerator(const Eigen::VectorXd& premise) const {
  Eigen::MatrixXd numerator(joints, 3 * joints);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(joints, joints);
  numerator << -2.0e4 * one, -9.0e5 * one, -9.0e2 * one;
  numerator.array() += 20.0 * premise(0);
  return numerator;
}

Eigen::MatrixXd TestArm::lyapunov() const {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(3 * joints, 3 * joints);
  for (int j = 0; j < joints; ++j) {
    matrix(j, j) = 2.0 + 0.1 * j;
    matrix(joints + j, joints + j) = 900.0;
    matrix(2 * joints + j, 2 * joints + j) = 0.01;
    matrix(j, joints + j) = matrix(joints + j, j) = -15.0;
    matrix(j, 2 * joints + j) = matrix(2 * joints + j, j) = -0.02;
  }
  return matrix;
}

Eigen::VectorXd TestArm::schedule(const Eigen::VectorXd& angle, const Eigen::VectorXd& speed) const {
  return Eigen::Vector2d(std::clamp(std::cos(angle(0)), kLower, kUpper),
                         std::clamp(speed(0) * std::sin(angle(0)), -kFastest, kFastest));
}

Json TestArm::schedule_program() const {
  return {{"outputs", 2}, {"code", Json::parse(R"([["angle",0],["cos"],["speed",0],["angle",0],["sin"],["mul"]])")}};
}

Json TestArm::schedule_table(const std::vector<Eigen::MatrixXd>& vertices) const {
  const auto pair = [&](std::size_t first) { return Json::array({rows(vertices[first]), rows(vertices[first + 1])}); };
  return {{"premises", 2},
          {"lower", {kLower, -kFastest}},
          {"upper", {kUpper, kFastest}},
          {"centre", {kCentre, 0.0}},
          {"blocks",
           {{{"kind", "box"}, {"premises", {0}}, {"vertices", pair(0)}},
            {{"kind", "box"}, {"premises", {1}}, {"vertices", pair(2)}}}}};
}

std::vector<double> TestArm::schedule_weights(const Eigen::VectorXd& angle, const Eigen::VectorXd& speed) const {
  const Eigen::VectorXd z = schedule(angle, speed);
  const double first = (z(0) - kLower) / (kUpper - kLower);
  const double second = (z(1) + kFastest) / (2.0 * kFastest);
  return {0.5 * (1.0 - first), 0.5 * first, 0.5 * (1.0 - second), 0.5 * second};
}

Eigen::MatrixXd TestArm::state_gain(int i) const {
  Eigen::MatrixXd gain(joints, 2 * joints);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(joints, joints);
  gain << -(3000.0 + 40.0 * i) * one, -(200.0 + 3.0 * i) * one;
  gain.array() += 1.7 * std::sin(static_cast<double>(i));
  return gain;
}

Eigen::MatrixXd TestArm::state_lyapunov(int i) const {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(2 * joints, 2 * joints);
  for (int j = 0; j < joints; ++j) {
    matrix(j, j) = 0.5 + 0.1 * i;
    matrix(joints + j, joints + j) = 8.0 - 0.5 * i;
    matrix(j, joints + j) = matrix(joints + j, j) = -0.3;
  }
  return matrix;
}

std::vector<Eigen::MatrixXd> TestArm::numbered(int count, Eigen::MatrixXd (TestArm::*matrix)(int) const) const {
  std::vector<Eigen::MatrixXd> result;
  for (int i = 0; i < count; ++i) {
    result.push_back((this->*matrix)(i));
  }
  return result;
}

Eigen::MatrixXd TestArm::weights(int size) {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Constant(size, size, -0.3);
  for (int i = 0; i < size; ++i) {
    matrix(i, i) = 2.0 + 0.5 * i;
  }
  return matrix;
}

Json TestArm::lyapunov_bound() const { return {{"signals", rows(weights(5))}, {"joints", rows(weights(joints))}}; }

Json TestArm::inertia_table() const {
  return table_of([this](const Eigen::VectorXd& premise) { return inertia_of_premises(premise); });
}

Json TestArm::table_of(const std::function<Eigen::MatrixXd(const Eigen::VectorXd&)>& matrix) const {
  Json blocks = Json::array();
  for (int p = 0; p < joints; ++p) {
    Json vertices = Json::array();
    for (const double corner : {kLower, kUpper}) {
      Eigen::VectorXd premise = Eigen::VectorXd::Constant(joints, kCentre);
      premise(p) += joints * (corner - kCentre);
      vertices.push_back(rows(matrix(premise)));
    }
    blocks.push_back({{"kind", "box"}, {"premises", Json::array({p})}, {"vertices", vertices}});
  }
  const auto repeated = [this](double value) { return Json(std::vector<double>(joints, value)); };
  return {{"premises", joints},
          {"lower", repeated(kLower)},
          {"upper", repeated(kUpper)},
          {"centre", repeated(kCentre)},
          {"blocks", blocks}};
}

Json law_table(const std::string& kind, const TestArm& arm) {
  const auto repeated = [&arm](double value) { return Json(std::vector<double>(arm.joints, value)); };
  Json law = {{"kind", kind}, {"inertia", arm.inertia_table()}};
  if (kind == "dob-acceleration") {
    law.update({{"feedback", {{"kp", -4800.0}, {"kd", -120.0}, {"ki", -64000.0}}},
                {"observer", {0.9, 550.0, 150000.0, 1.6e7}},
                {"filter_time_constant_s", 1e-3},
                {"disturbance_compensation", true}});
  } else if (kind == "dob-torque") {
    law.update({{"feedback", arm.table_of([&arm](const Eigen::VectorXd& z) { return arm.feedback(z); })},
                {"observer", arm.table_of([&arm](const Eigen::VectorXd& z) { return arm.observer(z); })},
                {"filter_time_constant_s", 1e-3}});
  } else if (kind == "hinf-tracking") {
    law.update({{"numerator", arm.table_of([&arm](const Eigen::VectorXd& z) { return arm.numerator(z); })},
                {"lyapunov", arm.rows(arm.lyapunov())},
                {"velocity_filter_time_constant_s", 2e-3}});
  } else if (kind == "state-feedback") {
    law.update({{"gain", arm.schedule_table(arm.numbered(TestArm::kScheduleVertices, &TestArm::state_gain))},
                {"velocity_filter_time_constant_s", 2e-3}});
  } else if (kind == "descriptor-feedback") {
    law.update({{"numerator", arm.schedule_table(arm.numbered(TestArm::kScheduleVertices, &TestArm::state_gain))},
                {"lyapunov", arm.rows(arm.state_lyapunov(0))},
                {"velocity_filter_time_constant_s", 2e-3}});
  } else if (kind == "delayed-feedback") {
    Json numerators = Json::array();
    for (const Eigen::MatrixXd& numerator : arm.numbered(64, &TestArm::state_gain)) {
      numerators.push_back(arm.rows(numerator));
    }
    law.update({{"lyapunov", arm.schedule_table(arm.numbered(TestArm::kScheduleVertices, &TestArm::state_lyapunov))},
                {"numerators", numerators},
                {"window_samples", 7},
                {"descriptor", true},
                {"velocity_filter_time_constant_s", 2e-3}});
  } else if (kind == "pid") {
    law.update({{"kp", repeated(4000.0)},
                {"kd", repeated(300.0)},
                {"ki", repeated(9000.0)},
                {"velocity_filter_time_constant_s", 2e-3}});
  } else if (kind == "motor-pid") {  // with a chain only, see with_chain()
    law.update({{"feedback", {{"kp", -31500.0}, {"kd", -700.0}, {"ki", -126000.0}}},
                {"observer", {0.8, 250.0, 40000.0, 2.5e6}},
                {"rotor_inertia_kg_m2", repeated(0.5)},
                {"stiffness_nm_rad", repeated(2e4)},
                {"correction_bandwidth_rad_s", 3.0},
                {"correction_source", "motor-torque"},
                {"friction_viscous_nm_s", repeated(0.5)},
                {"friction_coulomb_nm", repeated(1.0)},
                {"dead_zone_rad", 2e-5}});
  } else if (kind == "link-damped") {  // likewise
    law.update({{"feedback", {{"kp", -31500.0}, {"kd", -700.0}, {"ki", 0.0}}},
                {"observer", {0.9, 600.0, 150000.0, 1.5e7}},
                {"filter_time_constant_s", 0.01},
                {"inertia_scale", 0.8},
                {"rotor_inertia_kg_m2", repeated(0.5)},
                {"stiffness_nm_rad", repeated(2e4)},
                {"relative_damping_nm_s", repeated(60.0)},
                {"friction_viscous_nm_s", repeated(0.5)},
                {"friction_coulomb_nm", repeated(1.0)}});
  } else {
    law.update({{"gp", repeated(1200.0)},
                {"gd", repeated(60.0)},
                {"gi", repeated(8000.0)},
                {"velocity_filter_time_constant_s", 2e-3},
                {"disturbance_observer_bandwidth_rad_s", kind == "ctc-dob" ? 50.0 : 0.0}});
  }
  return law;
}

bool has_schedule(const std::string& kind) {
  return kind == "state-feedback" || kind == "descriptor-feedback" || kind == "delayed-feedback";
}

Json artifact_table(const std::string& kind, int joints) {
  const TestArm arm{joints};
  Json programs = {{"premises", arm.premises_program()}, {"gravity", arm.gravity_program()}};
  if (kind == "pid") {
    programs["coriolis_reference"] = arm.coriolis_program("reference_speed");
  } else if (kind == "ctc" || kind == "ctc-dob") {
    programs["coriolis"] = arm.coriolis_program("speed");
  } else if (has_schedule(kind)) {
    programs["schedule"] = arm.schedule_program();
  }
  const Json interval = Json(std::vector<Json>(joints, Json::array({-2.0, 2.0})));
  return {{"schema", "quasilpv.artifact"},
          {"schema_version", 1},
          {"name", "test-arm-" + kind},
          {"creator", {{"tool", "artifact_fixture"}, {"version", "1"}}},
          {"design_hash", std::string(64, 'a')},
          {"units", "SI"},
          {"sample_period_s", kSamplePeriod},
          {"joints", joints},
          {"robot", {{"id", "test-arm"}, {"parameters", {{"gravity_m_s2", 9.81}}}}},
          {"payloads", Json::object()},
          {"domain", {{"angle_rad", interval}, {"speed_rad_s", interval}}},
          {"limits",
           {{"torque_nm", std::vector<double>(joints, 1500.0)}, {"slew_nm_per_s", std::vector<double>(joints, 1e6)}}},
          {"programs", programs},
          {"law", law_table(kind, arm)},
          {"witness", nullptr},
          {"verification", {{"note", "\u00fcbung \"quoted\"\n"}}}};
}

Json with_chain(Json document) {
  const int joints = document["joints"].get<int>();
  Json bodies = Json::array();
  for (int k = 0; k < joints; ++k) {
    Json axis = {0.0, 0.0, 0.0};
    axis[static_cast<std::size_t>(k % 3)] = 1.0;
    bodies.push_back({{"name", "joint" + std::to_string(k)},
                      {"kind", "revolute"},
                      {"rotation", {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}},
                      {"translation_m", {0.1, 0.02, 0.3}},
                      {"axis", axis},
                      {"mass_kg", 3.0},
                      {"first_moment_kg_m", {0.0, 0.1, 0.4}},
                      {"rotational_kg_m2", {{0.2, 0.0, 0.0}, {0.0, 0.2, 0.0}, {0.0, 0.0, 0.1}}},
                      {"rotor_inertia_kg_m2", 0.1}});
  }
  document["law"]["inertia"] = {{"kind", "tree"}, {"gravity_m_s2", {0.0, 0.0, -9.81}}, {"joints", bodies}};
  document["law"]["gravity_load"] = {{"mass_kg", 1.5}, {"first_moment_kg_m", {0.0, 0.0, 0.2}}};
  document["programs"] = Json::object();
  document["schema_version"] = 2;
  return document;
}

Json with_hash(Json document) {
  document["hash"] = sha256_hex(canonical_json(document));
  return document;
}

std::string json_twin(const Json& document) { return canonical_json(with_hash(document)); }

std::string cbor_twin(const Json& document) { return canonical_cbor(with_hash(document)); }

JointArray to_joint_array(const Eigen::VectorXd& values) {
  JointArray array{};
  for (Eigen::Index j = 0; j < values.size(); ++j) {
    array[static_cast<std::size_t>(j)] = values(j);
  }
  return array;
}

Eigen::VectorXd to_vector(const JointArray& array, int joints) {
  return Eigen::Map<const Eigen::VectorXd>(array.data(), joints);
}

}  // namespace quasilpv::testing
