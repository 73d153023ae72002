#include "quasilpv/serial_arm.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "plants/plant_table.hpp"
#include "quasilpv/decimal.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

using JointVector = SerialArm::JointVector;
using JointMatrix = SerialArm::JointMatrix;

// A pivot of the Cholesky factorisation of M is the inertia a joint has left when the joints before it are free to
// move. Below this fraction of its diagonal entry, accelerations have lost all but four of their digits.
constexpr double kSmallestPivotRatio = 1e-12;

// S x: relative joint rates -> absolute link rates.
JointVector absolute(Plant::ConstVector relative) noexcept {
  JointVector sum = relative;
  for (Eigen::Index k = 1; k < sum.size(); ++k) {
    sum[k] += sum[k - 1];
  }
  return sum;
}

// S' x: torques on the links -> joint torques.
JointVector joint_torques(JointVector link) noexcept {
  for (Eigen::Index k = link.size() - 1; k > 0; --k) {
    link[k - 1] += link[k];
  }
  return link;
}

// S' X S.
JointMatrix relative(JointMatrix x) noexcept {
  for (Eigen::Index k = x.rows() - 1; k > 0; --k) {
    x.row(k - 1) += x.row(k);
  }
  for (Eigen::Index k = x.cols() - 1; k > 0; --k) {
    x.col(k - 1) += x.col(k);
  }
  return x;
}

JointArray joint_array(Plant::ConstVector x) noexcept {
  JointArray array{};
  std::copy(x.data(), x.data() + x.size(), array.begin());
  return array;
}

double sum_of_masses_beyond(const std::vector<PlanarLink>& links, std::size_t k) {
  double sum = 0.0;
  for (std::size_t l = k + 1; l < links.size(); ++l) {
    sum += links[l].mass_kg;
  }
  return sum;
}

// D of the class documentation, kg m^2.
JointMatrix coupling_matrix(const std::vector<PlanarLink>& links) {
  const Eigen::Index n = static_cast<Eigen::Index>(links.size());
  JointMatrix coupling(n, n);
  for (Eigen::Index l = 0; l < n; ++l) {
    const PlanarLink& link = links[static_cast<std::size_t>(l)];
    const double mass_beyond = sum_of_masses_beyond(links, static_cast<std::size_t>(l));
    coupling(l, l) = link.inertia_kg_m2 + link.length_m * link.length_m * mass_beyond;
    for (Eigen::Index k = 0; k < l; ++k) {
      coupling(k, l) =
          (link.mass_kg * link.com_m + link.length_m * mass_beyond) * links[static_cast<std::size_t>(k)].length_m;
      coupling(l, k) = coupling(k, l);
    }
  }
  return coupling;
}

// False if the matrix is indefinite, singular, singular to working precision, or not finite.
bool is_positive_definite(const Eigen::LLT<JointMatrix>& cholesky, const JointMatrix& matrix) {
  if (cholesky.info() != Eigen::Success) {
    return false;
  }
  const JointVector pivots = cholesky.matrixLLT().diagonal().array().square();
  return (pivots.array() > kSmallestPivotRatio * matrix.diagonal().array()).all();
}

}  // namespace

// Sines and cosines of the absolute angles; those of their differences follow from the addition theorem.
struct SerialArm::Posture {
  JointVector sine;
  JointVector cosine;

  double sine_of_difference(Eigen::Index k, Eigen::Index l) const { return sine[k] * cosine[l] - cosine[k] * sine[l]; }
  double cosine_of_difference(Eigen::Index k, Eigen::Index l) const {
    return cosine[k] * cosine[l] + sine[k] * sine[l];
  }
};

void check_serial_arm(const SerialArmParameters& parameters, const std::string& source, const std::string& path) {
  if (!std::isfinite(parameters.gravity_m_s2)) {
    throw InputError(source, path + ".gravity_m_s2", format_number(parameters.gravity_m_s2), "a finite number");
  }
  const std::size_t n = parameters.links.size();
  if (n < 1 || n > static_cast<std::size_t>(kMaxJoints)) {
    throw InputError(source, path + ".links", std::to_string(n) + " links", "1 to " + std::to_string(kMaxJoints));
  }
  for (std::size_t k = 0; k < n; ++k) {
    check_link(parameters.links[k], source, path + ".links[" + std::to_string(k) + "]");
  }
  // The stretched arm: every cos(alpha_k - alpha_l) is 1, the links are coupled most.
  const JointMatrix coupling = coupling_matrix(parameters.links);
  if (!is_positive_definite(coupling.llt(), coupling)) {
    throw InputError(source, path + ".links", "a mass matrix that is singular to working precision",
                     "masses and inertias of comparable size (indefinite inertia)");
  }
}

SerialArm::SerialArm(SerialArmParameters parameters) : parameters_(std::move(parameters)) {
  check_serial_arm(parameters_, "serial arm", "'" + parameters_.label + "'");
  joints_ = static_cast<int>(parameters_.links.size());
  coupling_ = coupling_matrix(parameters_.links);
  gravity_moment_.resize(joints_);
  friction_.resize(joints_);
  for (std::size_t k = 0; k < parameters_.links.size(); ++k) {
    const PlanarLink& link = parameters_.links[k];
    const double first_moment = link.mass_kg * link.com_m + link.length_m * sum_of_masses_beyond(parameters_.links, k);
    gravity_moment_[static_cast<Eigen::Index>(k)] = parameters_.gravity_m_s2 * first_moment;
    friction_[static_cast<Eigen::Index>(k)] = link.friction_nm_s;
  }
}

Eigen::VectorXd SerialArm::initial_state(const JointArray& angle, const JointArray& speed) const {
  Eigen::VectorXd y(size());
  y.head(joints_) = Eigen::Map<const Eigen::VectorXd>(angle.data(), joints_);
  y.tail(joints_) = Eigen::Map<const Eigen::VectorXd>(speed.data(), joints_);
  return y;
}

SerialArm::Posture SerialArm::posture(ConstVector angle) const noexcept {
  const JointVector alpha = absolute(angle);
  return {alpha.array().sin(), alpha.array().cos()};
}

JointMatrix SerialArm::mass_matrix(const Posture& at) const noexcept {
  JointMatrix links(joints_, joints_);
  for (Eigen::Index l = 0; l < joints_; ++l) {
    for (Eigen::Index k = 0; k < joints_; ++k) {
      links(k, l) = coupling_(k, l) * at.cosine_of_difference(k, l);
    }
  }
  return relative(links);
}

JointMatrix SerialArm::mass_matrix(ConstVector angle) const { return mass_matrix(posture(angle)); }

JointVector SerialArm::inverse_dynamics(const Posture& at, ConstVector speed, ConstVector acceleration) const noexcept {
  const JointVector link_speed_squared = absolute(speed).array().square();
  const JointVector link_acceleration = absolute(acceleration);
  JointVector torque = gravity_moment_.cwiseProduct(at.sine);
  for (Eigen::Index l = 0; l < joints_; ++l) {
    for (Eigen::Index k = 0; k < joints_; ++k) {
      torque[k] += coupling_(k, l) * (at.cosine_of_difference(k, l) * link_acceleration[l] +
                                      at.sine_of_difference(k, l) * link_speed_squared[l]);
    }
  }
  return joint_torques(torque) + friction_.cwiseProduct(speed);
}

JointVector SerialArm::inverse_dynamics(ConstVector angle, ConstVector speed, ConstVector acceleration) const {
  return inverse_dynamics(posture(angle), speed, acceleration);
}

JointVector SerialArm::applied_torque(double t) const noexcept {
  return Eigen::Map<const Eigen::VectorXd>(joint_torque(t).data(), joints_);
}

void SerialArm::residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept {
  const auto speed = y.tail(joints_);
  residual.head(joints_) = y_dot.head(joints_) - speed;
  residual.tail(joints_) = inverse_dynamics(posture(y.head(joints_)), speed, y_dot.tail(joints_)) - applied_torque(t);
}

// With h_k(alpha, Omega, A) the torque on link k, the blocks are S' (dh/dalpha) S, S' (dh/dOmega) S + diag(f) and M.
void SerialArm::jacobian(double /*t*/, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept {
  const int n = joints_;
  const Posture at = posture(y.head(n));
  const JointVector link_speed = absolute(y.tail(n));
  const JointVector link_acceleration = absolute(y_dot.tail(n));
  JointMatrix by_angle = JointMatrix(gravity_moment_.cwiseProduct(at.cosine).asDiagonal());
  JointMatrix by_speed(n, n);
  for (Eigen::Index l = 0; l < n; ++l) {
    for (Eigen::Index k = 0; k < n; ++k) {
      const double sine = coupling_(k, l) * at.sine_of_difference(k, l);
      const double cosine = coupling_(k, l) * at.cosine_of_difference(k, l);
      const double by_difference = cosine * link_speed[l] * link_speed[l] - sine * link_acceleration[l];
      by_angle(k, k) += by_difference;
      by_angle(k, l) -= by_difference;
      by_speed(k, l) = 2.0 * sine * link_speed[l];
    }
  }
  jacobian.topLeftCorner(n, n).setIdentity();
  jacobian.topLeftCorner(n, n) *= c_j;
  jacobian.topRightCorner(n, n).setIdentity();
  jacobian.topRightCorner(n, n) *= -1.0;
  jacobian.bottomLeftCorner(n, n) = relative(by_angle);
  jacobian.bottomRightCorner(n, n) = relative(by_speed) + c_j * mass_matrix(at);
  jacobian.bottomRightCorner(n, n).diagonal() += friction_;
}

void SerialArm::derivative(double t, ConstVector y, Vector y_dot) const {
  const auto speed = y.tail(joints_);
  const Posture at = posture(y.head(joints_));
  const JointMatrix mass = mass_matrix(at);
  const Eigen::LLT<JointMatrix> cholesky(mass);
  if (!is_positive_definite(cholesky, mass)) {
    throw PlantError("serial arm '" + parameters_.label + "': singular mass matrix at t = " + format_number(t) + " s");
  }
  const JointVector rest = JointVector::Zero(joints_);
  y_dot.head(joints_) = speed;
  y_dot.tail(joints_) = cholesky.solve(applied_torque(t) - inverse_dynamics(at, speed, rest));
}

PlantSample SerialArm::sample(double t, ConstVector y) const {
  Eigen::VectorXd y_dot(size());
  derivative(t, y, y_dot);
  return {joint_array(y.head(joints_)), joint_array(y.tail(joints_)), joint_array(y_dot.tail(joints_)),
          external_torque().at(t)};
}

double SerialArm::energy(ConstVector angle, ConstVector speed) const {
  const Posture at = posture(angle);
  const JointVector rate = speed;
  return 0.5 * rate.dot(mass_matrix(at) * rate) - gravity_moment_.dot(at.cosine);
}

namespace plants {

PlantKind serial_arm() {
  using P = SerialArmParameters;
  PlantTable<P> arm;
  arm.text("label", &P::label);
  arm.number("gravity_m_s2", &P::gravity_m_s2);
  arm.list("links", &P::links, planar_link_table());
  return arm.kind<SerialArm>("serial-arm", check_serial_arm);
}

}  // namespace plants
}  // namespace quasilpv
