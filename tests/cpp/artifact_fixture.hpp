// Artifacts for tests, built here from formulas that stand here: an n-joint arm with easy closed forms.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "document/document.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv::testing {

/// M(y) = M_0 + sum_p cos(y_p) M_p, G_j(y) = 9.81 (j + 1) sin(y_j), N(y, w) = diag(0.3 (j + 1) w_j sin(y_j)).
/// M is diagonally dominant, so positive definite everywhere; one premise per joint, cos(y_p) in [-0.5, 1].
struct TestArm {
  int joints;

  static constexpr double kLower = -0.5;
  static constexpr double kUpper = 1.0;
  static constexpr double kCentre = 0.2;
  static constexpr double kFastest = 1.5;  ///< bound of the premise of the speed
  static constexpr int kScheduleVertices = 4;

  Eigen::MatrixXd constant_inertia() const;

  Eigen::MatrixXd inertia_slope(int premise) const;

  Eigen::MatrixXd inertia_of_premises(const Eigen::VectorXd& premise) const;

  Eigen::VectorXd premises(const Eigen::VectorXd& angle) const;

  Eigen::MatrixXd inertia(const Eigen::VectorXd& angle) const;

  Eigen::VectorXd gravity(const Eigen::VectorXd& angle) const;

  /// N(angle, speed) v
  Eigen::VectorXd coriolis(const Eigen::VectorXd& angle, const Eigen::VectorXd& speed, const Eigen::VectorXd& v) const;

  Json premises_program() const;

  Json gravity_program() const;

  /// N(y, w) v with v the operand named `factor`.
  Json coriolis_program(const std::string& factor) const;

  static Json rows(const Eigen::MatrixXd& matrix);

  /// Feedback [Kp Kd KI] of `dob-torque`: affine in the premises, and no multiple of the inertia.
  Eigen::MatrixXd feedback(const Eigen::VectorXd& premise) const;

  /// Observer gains [L1; L2; L3; L4] of `dob-torque`.
  Eigen::MatrixXd observer(const Eigen::VectorXd& premise) const;

  /// Y of `hinf-tracking`, and its P, in which the three states of a joint are coupled: gains near those of
  /// `dob-torque`.
  Eigen::MatrixXd numerator(const Eigen::VectorXd& premise) const;

  Eigen::MatrixXd lyapunov() const;

  /// The schedule of the stabilising laws: cos(y_0), as in the inertia, and a premise of the speed, w_0 sin(y_0).
  Eigen::VectorXd schedule(const Eigen::VectorXd& angle, const Eigen::VectorXd& speed) const;

  Json schedule_program() const;

  /// Vertices of the schedule as boxes: cos(y_0) at its bounds, then w_0 sin(y_0) at its bounds.
  Json schedule_table(const std::vector<Eigen::MatrixXd>& vertices) const;

  /// Weights of these vertices.
  std::vector<double> schedule_weights(const Eigen::VectorXd& angle, const Eigen::VectorXd& speed) const;

  /// Gain [Kp Kd] number i of the stabilising laws: no two are alike.
  Eigen::MatrixXd state_gain(int i) const;

  /// P number i of the stabilising laws: positive definite, no two alike.
  Eigen::MatrixXd state_lyapunov(int i) const;

  std::vector<Eigen::MatrixXd> numbered(int count, Eigen::MatrixXd (TestArm::*matrix)(int) const) const;

  /// Weights of the five known signals of `dob-acceleration` and of the joints, both diagonally dominant.
  static Eigen::MatrixXd weights(int size);

  Json lyapunov_bound() const;

  Json inertia_table() const;

  /// Groups of one premise: X_i = X(z_c + G (c_p - z_c,p) e_p) for X affine in the premises.
  Json table_of(const std::function<Eigen::MatrixXd(const Eigen::VectorXd&)>& matrix) const;
};

inline constexpr double kSamplePeriod = 1e-3;

/// Every law kind.
inline constexpr const char* kLawKinds[] = {
    "dob-acceleration", "dob-torque", "hinf-tracking", "state-feedback", "descriptor-feedback",
    "delayed-feedback", "pid",        "ctc",           "ctc-dob"};

/// Member `law` of kind `kind`, with gains that make sense at 1 kHz.
Json law_table(const std::string& kind, const TestArm& arm);

/// The law kinds that stabilise: feedback of the state only, scheduled by a program of its own.
bool has_schedule(const std::string& kind);

/// A complete artifact without its hash.
Json artifact_table(const std::string& kind, int joints);

/// The kinds of laws whose design inertia may be a chain of bodies.
inline constexpr const char* kChainLaws[] = {"dob-acceleration", "pid", "ctc", "ctc-dob", "motor-pid", "link-damped"};

/// The same artifact for a robot in space: a chain of bodies about axes in turn, with a load for its gravity only.
Json with_chain(Json document);

Json with_hash(Json document);

/// JSON twin of a document without hash.
std::string json_twin(const Json& document);

/// CBOR twin of a document without hash.
std::string cbor_twin(const Json& document);

/// The message of the InputError that `action` must throw, or a note that it threw none.
template <class Action>
std::string refusal(Action action) {
  try {
    action();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "accepted";
}

JointArray to_joint_array(const Eigen::VectorXd& values);

Eigen::VectorXd to_vector(const JointArray& array, int joints);

}  // namespace quasilpv::testing
