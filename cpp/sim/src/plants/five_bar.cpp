#include "quasilpv/five_bar.hpp"

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <utility>

#include "plants/plant_table.hpp"
#include "quasilpv/decimal.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

using Coordinates = FiveBar::Coordinates;
using ConstraintJacobian = FiveBar::ConstraintJacobian;
using Eigen::Array2d;
using Eigen::Matrix2d;
using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector4d;

// |sin(q_1 - q_2)| from which on the multipliers and with them the motion are ill-conditioned.
constexpr double kSmallestSine = 0.05;
constexpr double kMultiplierTolerance = 1.0;
constexpr int kMaxProjections = 20;

// Where the parts of y begin.
constexpr int kSpeed = 4, kMultiplier = 8, kSecondMultiplier = 10;

// The residual and the iteration matrix have one size per formulation; these views name their rows.
using VectorView = Eigen::Map<const Vector4d>;

VectorView angles(Plant::ConstVector y) noexcept { return VectorView(y.data()); }
VectorView speeds(Plant::ConstVector y) noexcept { return VectorView(y.data() + kSpeed); }

JointArray active(const Coordinates& x) noexcept { return {x[0], x[1]}; }

}  // namespace

struct FiveBar::Posture {
  Eigen::Array4d sine, cosine;       // of phi
  Array2d elbow_sine, elbow_cosine;  // of q_i - th_i
  ConstraintJacobian links;          // column i: +-length (cos phi_i, sin phi_i); h is the sum of the columns

  // The columns turned by a right angle.
  ConstraintJacobian jacobian() const noexcept {
    ConstraintJacobian turned;
    turned.row(0) = -links.row(1);
    turned.row(1) = links.row(0);
    return turned;
  }
  Vector2d constraint() const noexcept { return links.rowwise().sum(); }
  // gamma = (dJ/dt) v.
  Vector2d constraint_bias(const Coordinates& v) const noexcept { return -links * v.cwiseAbs2(); }
  // sin(q_1 - q_2).
  double sine_between_passive_links() const noexcept { return sine[2] * cosine[3] - cosine[2] * sine[3]; }
};

void check_five_bar(const FiveBarParameters& parameters, const std::string& source, const std::string& path) {
  const auto require = [&](bool holds, const char* field, double got, const char* expected) {
    if (!holds) {
      throw InputError(source, path + "." + field, format_number(got), expected);
    }
  };
  require(std::isfinite(parameters.gravity_m_s2), "gravity_m_s2", parameters.gravity_m_s2, "a finite number");
  check_link(parameters.active, source, path + ".active");
  check_link(parameters.passive, source, path + ".passive");
  require(std::isfinite(parameters.spring_nm_rad) && parameters.spring_nm_rad >= 0.0, "spring_nm_rad",
          parameters.spring_nm_rad, "a number >= 0");
  for (const double rest : parameters.spring_rest_rad) {
    require(std::isfinite(rest), "spring_rest_rad", rest, "finite numbers");
  }
  require(std::isfinite(parameters.baumgarte_per_s) && parameters.baumgarte_per_s >= 0.0, "baumgarte_per_s",
          parameters.baumgarte_per_s, "a number >= 0");
}

FiveBar::FiveBar(FiveBarParameters parameters) : parameters_(std::move(parameters)) {
  check_five_bar(parameters_, "five-bar", "'" + parameters_.label + "'");
  const PlanarLink& a = parameters_.active;
  const PlanarLink& b = parameters_.passive;
  gravity_active_ = parameters_.gravity_m_s2 * (a.mass_kg * a.com_m + b.mass_kg * a.length_m);
  gravity_passive_ = parameters_.gravity_m_s2 * b.mass_kg * b.com_m;
  coupling_ = b.mass_kg * b.com_m * a.length_m;
  inertia_active_ = a.inertia_kg_m2 + b.mass_kg * a.length_m * a.length_m;
  inertia_passive_ = b.inertia_kg_m2;
}

Eigen::VectorXd FiveBar::differential() const {
  Eigen::VectorXd id = Eigen::VectorXd::Zero(size());
  id.head<kMultiplier>().setOnes();
  return id;
}

Eigen::VectorXd FiveBar::absolute_tolerance(double tolerance) const {
  Eigen::VectorXd tolerances = Eigen::VectorXd::Constant(size(), kMultiplierTolerance);
  tolerances.head<kMultiplier>().setConstant(tolerance);
  return tolerances;
}

Eigen::VectorXd FiveBar::initial_state(const JointArray& angle, const JointArray& speed) const {
  const double opening = angle[1] - angle[0];
  const double half_base = parameters_.active.length_m * std::sin(0.5 * opening);  // half the distance of the elbows
  if (!(opening > 0.0 && std::sin(opening) > 0.0 && half_base < parameters_.passive.length_m)) {
    throw PlantError("five-bar '" + parameters_.label + "': cannot be assembled at active angles " +
                     format_number(angle[0]) + ", " + format_number(angle[1]) +
                     " rad: expected 0 < difference < pi and elbows nearer than twice the passive length");
  }
  const double direction = 0.5 * (angle[0] + angle[1]);  // of the tool, seen from the motor axis
  const double spread = std::asin(half_base / parameters_.passive.length_m);
  const Coordinates phi(angle[0], angle[1], direction + spread, direction - spread);
  const Posture at = posture(phi);
  require_regular(0.0, at);
  const ConstraintJacobian J = at.jacobian();
  const Vector2d active_speed(speed[0], speed[1]);
  Eigen::VectorXd y = Eigen::VectorXd::Zero(size());
  y.head<4>() = phi;
  y.segment<2>(kSpeed) = active_speed;
  y.segment<2>(kSpeed + 2) = -J.rightCols<2>().inverse() * (J.leftCols<2>() * active_speed);
  return y;
}

FiveBar::Posture FiveBar::posture(const Coordinates& phi) const noexcept {
  Posture at;
  at.sine = phi.array().sin();
  at.cosine = phi.array().cos();
  at.elbow_sine = at.sine.tail<2>() * at.cosine.head<2>() - at.cosine.tail<2>() * at.sine.head<2>();
  at.elbow_cosine = at.cosine.tail<2>() * at.cosine.head<2>() + at.sine.tail<2>() * at.sine.head<2>();
  const double a = parameters_.active.length_m;
  const double b = parameters_.passive.length_m;
  const Eigen::Array4d signed_length(a, -a, b, -b);
  at.links.row(0) = signed_length * at.cosine;
  at.links.row(1) = signed_length * at.sine;
  return at;
}

Matrix4d FiveBar::mass_matrix(const Posture& at) const noexcept {
  Matrix4d mass = Vector4d(inertia_active_, inertia_active_, inertia_passive_, inertia_passive_).asDiagonal();
  mass(0, 2) = mass(2, 0) = coupling_ * at.elbow_cosine[0];
  mass(1, 3) = mass(3, 1) = coupling_ * at.elbow_cosine[1];
  return mass;
}

// The legs do not see each other in M: one 2 x 2 inverse each.
Matrix4d FiveBar::inverse_mass_matrix(const Posture& at) const noexcept {
  Matrix4d inverse = Matrix4d::Zero();
  for (int leg = 0; leg < 2; ++leg) {
    const double coupled = coupling_ * at.elbow_cosine[leg];
    const double determinant = inertia_active_ * inertia_passive_ - coupled * coupled;
    inverse(leg, leg) = inertia_passive_ / determinant;
    inverse(leg + 2, leg + 2) = inertia_active_ / determinant;
    inverse(leg, leg + 2) = inverse(leg + 2, leg) = -coupled / determinant;
  }
  return inverse;
}

Matrix4d FiveBar::mass_matrix(const Coordinates& phi) const noexcept { return mass_matrix(posture(phi)); }

Vector2d FiveBar::constraint(const Coordinates& phi) const noexcept { return posture(phi).constraint(); }

ConstraintJacobian FiveBar::constraint_jacobian(const Coordinates& phi) const noexcept {
  return posture(phi).jacobian();
}

Coordinates FiveBar::inverse_dynamics(const Posture& at, const Coordinates& phi, const Coordinates& v,
                                      const Coordinates& acceleration) const noexcept {
  const Array2d active_speed = v.head<2>(), passive_speed = v.tail<2>();
  const Array2d elbow_friction = parameters_.passive.friction_nm_s * (passive_speed - active_speed);
  const Array2d spring =
      parameters_.spring_nm_rad * (phi.head<2>() - Vector2d::Map(parameters_.spring_rest_rad.data())).array();
  Coordinates torque;
  torque.head<2>() =
      inertia_active_ * acceleration.head<2>().array() +
      coupling_ * (at.elbow_cosine * acceleration.tail<2>().array() - at.elbow_sine * passive_speed.square()) +
      gravity_active_ * at.sine.head<2>() + parameters_.active.friction_nm_s * active_speed - elbow_friction + spring;
  torque.tail<2>() =
      inertia_passive_ * acceleration.tail<2>().array() +
      coupling_ * (at.elbow_cosine * acceleration.head<2>().array() + at.elbow_sine * active_speed.square()) +
      gravity_passive_ * at.sine.tail<2>() + elbow_friction;
  return torque;
}

Coordinates FiveBar::inverse_dynamics(const Coordinates& phi, const Coordinates& v,
                                      const Coordinates& acceleration) const noexcept {
  return inverse_dynamics(posture(phi), phi, v, acceleration);
}

Coordinates FiveBar::applied_torque(double t) const noexcept {
  const JointArray torque = joint_torque(t);
  return {torque[0], torque[1], 0.0, 0.0};
}

void FiveBar::residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept {
  const VectorView phi = angles(y), v = speeds(y), acceleration = speeds(y_dot);
  const Posture at = posture(phi);
  if (!(at.sine_between_passive_links() > 0.0)) {
    residual.setConstant(std::numeric_limits<double>::quiet_NaN());
    return;
  }
  const ConstraintJacobian J = at.jacobian();
  const Vector2d lambda = y.segment<2>(kMultiplier);
  residual.head<4>() = angles(y_dot) - v;
  residual.segment<4>(kSpeed) = inverse_dynamics(at, phi, v, acceleration) - applied_torque(t) - J.transpose() * lambda;
  if (parameters_.formulation == FiveBarFormulation::kGgl) {
    residual.head<4>() -= J.transpose() * y.segment<2>(kSecondMultiplier);
    residual.segment<2>(kMultiplier) = J * v;
    residual.segment<2>(kSecondMultiplier) = at.constraint();
  } else {
    const double alpha = parameters_.baumgarte_per_s;
    residual.segment<2>(kMultiplier) =
        J * (acceleration + 2.0 * alpha * v) + at.constraint_bias(v) + alpha * alpha * at.constraint();
  }
}

// d(dynamics)/d(phi) and d(dynamics)/dv are diagonal in their four 2 x 2 blocks, as the legs meet in lambda only. With
// e_i the columns of `links`, J_i is e_i turned by a right angle and dJ_i/dphi_i = -e_i.
void FiveBar::jacobian(double /*t*/, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept {
  const VectorView phi = angles(y), v = speeds(y), acceleration = speeds(y_dot);
  const Posture at = posture(phi);
  const ConstraintJacobian J = at.jacobian();
  jacobian.setZero();
  jacobian.topLeftCorner<4, 4>().diagonal().setConstant(c_j);
  jacobian.block<4, 4>(0, kSpeed).diagonal().setConstant(-1.0);
  dynamics_jacobian(at, c_j, y, y_dot, jacobian);
  if (parameters_.formulation == FiveBarFormulation::kGgl) {
    jacobian.topLeftCorner<4, 4>().diagonal() += at.links.transpose() * y.segment<2>(kSecondMultiplier);
    jacobian.block<4, 2>(0, kSecondMultiplier) = -J.transpose();
    jacobian.block<2, 4>(kMultiplier, 0) = -at.links * v.asDiagonal();
    jacobian.block<2, 4>(kMultiplier, kSpeed) = J;
    jacobian.block<2, 4>(kSecondMultiplier, 0) = J;
  } else {
    const double alpha = parameters_.baumgarte_per_s;
    const Coordinates along_links = acceleration + 2.0 * alpha * v;
    const Coordinates across_links = (alpha * alpha - v.array().square()).matrix();
    const Coordinates by_speed = (-2.0 * v);
    jacobian.block<2, 4>(kMultiplier, 0) = J * across_links.asDiagonal() - at.links * along_links.asDiagonal();
    jacobian.block<2, 4>(kMultiplier, kSpeed) = at.links * by_speed.asDiagonal() + (2.0 * alpha + c_j) * J;
  }
}

void FiveBar::dynamics_jacobian(const Posture& at, double c_j, ConstVector y, ConstVector y_dot,
                                Matrix jacobian) const noexcept {
  const VectorView v = speeds(y), acceleration = speeds(y_dot);
  const Vector2d lambda = y.segment<2>(kMultiplier);
  const double elbow_friction = parameters_.passive.friction_nm_s;
  auto by_angle = jacobian.block<4, 4>(kSpeed, 0);
  auto by_speed = jacobian.block<4, 4>(kSpeed, kSpeed);
  by_angle.diagonal() = at.links.transpose() * lambda;
  for (int i = 0, k = 2; i < 2; ++i, ++k) {  // active and passive link of a leg
    const double sine = coupling_ * at.elbow_sine[i], cosine = coupling_ * at.elbow_cosine[i];
    const double active_by_elbow = -sine * acceleration[k] - cosine * v[k] * v[k];
    const double passive_by_elbow = -sine * acceleration[i] + cosine * v[i] * v[i];
    by_angle(i, i) += gravity_active_ * at.cosine[i] + parameters_.spring_nm_rad - active_by_elbow;
    by_angle(i, k) = active_by_elbow;
    by_angle(k, i) = -passive_by_elbow;
    by_angle(k, k) += gravity_passive_ * at.cosine[k] + passive_by_elbow;
    by_speed(i, i) = c_j * inertia_active_ + parameters_.active.friction_nm_s + elbow_friction;
    by_speed(i, k) = c_j * cosine - 2.0 * sine * v[k] - elbow_friction;
    by_speed(k, i) = c_j * cosine + 2.0 * sine * v[i] - elbow_friction;
    by_speed(k, k) = c_j * inertia_passive_ + elbow_friction;
  }
  jacobian.block<4, 2>(kSpeed, kMultiplier) = -at.jacobian().transpose();
}

void FiveBar::require_regular(double t, const Posture& at) const {
  const double sine = at.sine_between_passive_links();
  if (!(sine >= kSmallestSine)) {
    throw PlantError("five-bar '" + parameters_.label + "': singular configuration at t = " + format_number(t) +
                     " s, sin(q1 - q2) = " + format_number(sine) + " < " + format_number(kSmallestSine) +
                     " (the passive links are in line, or the mechanism changed its assembly mode)");
  }
}

// M a - J' lambda = f and J a = g, by elimination of a.
FiveBar::Motion FiveBar::motion(double t, const Posture& at, const Coordinates& phi,
                                const Coordinates& v) const noexcept {
  const double alpha = parameters_.baumgarte_per_s;
  const ConstraintJacobian J = at.jacobian();
  const Matrix4d mobility = inverse_mass_matrix(at);
  const Coordinates force = applied_torque(t) - inverse_dynamics(at, phi, v, Coordinates::Zero());
  const Vector2d demanded = -at.constraint_bias(v) - 2.0 * alpha * (J * v) - alpha * alpha * at.constraint();
  const Eigen::Matrix<double, 4, 2> response = mobility * J.transpose();
  const Coordinates free = mobility * force;
  const Matrix2d compliance = J * response;
  const Vector2d lambda = compliance.inverse() * (demanded - J * free);
  return {free + response * lambda, lambda};
}

void FiveBar::derivative(double t, ConstVector y, Vector y_dot) const {
  const VectorView phi = angles(y), v = speeds(y);
  const Posture at = posture(phi);
  require_regular(t, at);
  y_dot.setZero();
  y_dot.head<4>() = v;
  y_dot.segment<4>(kSpeed) = motion(t, at, phi, v).acceleration;
}

Coordinates FiveBar::project_angles(double t, Coordinates phi) const {
  const double rounding =
      16.0 * std::numeric_limits<double>::epsilon() * (parameters_.active.length_m + parameters_.passive.length_m);
  for (int i = 0; i < kMaxProjections; ++i) {
    const Posture at = posture(phi);
    require_regular(t, at);
    const Vector2d h = at.constraint();
    if (h.cwiseAbs().maxCoeff() <= rounding) {
      return phi;
    }
    const ConstraintJacobian J = at.jacobian();
    const Eigen::Matrix<double, 4, 2> response = inverse_mass_matrix(at) * J.transpose();
    phi -= response * ((J * response).inverse() * h);
  }
  throw PlantError("five-bar '" + parameters_.label + "': the legs do not meet at t = " + format_number(t) +
                   " s, |h| = " + format_number(constraint(phi).norm()) + " m after the projection");
}

void FiveBar::make_consistent(double t, Vector y, Vector y_dot) const {
  const Coordinates phi = project_angles(t, angles(y));
  const Posture at = posture(phi);
  const ConstraintJacobian J = at.jacobian();
  const Eigen::Matrix<double, 4, 2> response = inverse_mass_matrix(at) * J.transpose();
  const Coordinates moving = speeds(y);
  const Coordinates v = moving - response * ((J * response).inverse() * (J * moving));
  const Motion moved = motion(t, at, phi, v);
  y.setZero();
  y.head<4>() = phi;
  y.segment<4>(kSpeed) = v;
  y.segment<2>(kMultiplier) = moved.multiplier;
  y_dot.setZero();
  y_dot.head<4>() = v;
  y_dot.segment<4>(kSpeed) = moved.acceleration;
}

PlantSample FiveBar::sample(double t, ConstVector y) const {
  const VectorView phi = angles(y), v = speeds(y);
  const Posture at = posture(phi);
  require_regular(t, at);
  return {active(phi), active(v), active(motion(t, at, phi, v).acceleration), external_torque().at(t)};
}

double FiveBar::energy(const Coordinates& phi, const Coordinates& v) const noexcept {
  const Posture at = posture(phi);
  const Vector2d stretch = phi.head<2>() - Vector2d::Map(parameters_.spring_rest_rad.data());
  return 0.5 * v.dot(mass_matrix(at) * v) - gravity_active_ * at.cosine.head<2>().sum() -
         gravity_passive_ * at.cosine.tail<2>().sum() + 0.5 * parameters_.spring_nm_rad * stretch.squaredNorm();
}

namespace plants {

PlantKind five_bar() {
  using P = FiveBarParameters;
  PlantTable<P> five_bar;
  five_bar.text("label", &P::label);
  five_bar.number("gravity_m_s2", &P::gravity_m_s2);
  five_bar.object("active", &P::active, planar_link_table());
  five_bar.object("passive", &P::passive, planar_link_table());
  five_bar.number("spring_nm_rad", &P::spring_nm_rad);
  five_bar.numbers("spring_rest_rad", &P::spring_rest_rad);
  five_bar.add({"formulation", "text"}, [](const Field& field, int /*joints*/, P& parameters) {
    const std::string name = field.text();
    if (name != "index1" && name != "ggl") {
      field.fail_choice({"index1", "ggl"});
    }
    parameters.formulation = name == "ggl" ? FiveBarFormulation::kGgl : FiveBarFormulation::kIndex1;
  });
  five_bar.number("baumgarte_per_s", &P::baumgarte_per_s);
  return five_bar.kind<FiveBar>("five-bar", check_five_bar);
}

}  // namespace plants
}  // namespace quasilpv
