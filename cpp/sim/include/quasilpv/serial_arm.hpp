// Planar serial arm with n links in a vertical plane.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "quasilpv/planar_link.hpp"
#include "quasilpv/plant.hpp"

namespace quasilpv {

/// Physical parameters of an arm; 1 to 7 links.
struct SerialArmParameters {
  std::string label;
  double gravity_m_s2 = 9.81;  ///< g; theta = 0 hangs for g > 0
  std::vector<PlanarLink> links;
};

/// Checks parameters and names the first wrong one. The parallel axis bound I >= m r^2 with I > 0 makes the mass matrix
/// positive definite at every posture; a mass matrix that is singular to working precision is refused as well.
/// `source` and `path` name the origin in the error. INIT-ONLY. Throws InputError.
void check_serial_arm(const SerialArmParameters& parameters, const std::string& source, const std::string& path);

/// The arm as a plant, y = (theta, w): relative joint angles theta (rad) and speeds w = theta' (rad/s).
///
///     theta' - w = 0
///     M(theta) w' + N(theta, w) w + G(theta) - torque = 0
///
/// With the absolute angles alpha = S theta from the downward vertical (S lower triangular, ones), Omega = S w, and
///
///     D_kk = I_k + L_k^2 sum_{l>k} m_l,     D_kl = (m_l r_l + L_l sum_{p>l} m_p) L_k   for k < l,
///     g_k  = g (m_k r_k + L_k sum_{l>k} m_l),
///
/// the kinetic energy is 1/2 sum_kl D_kl cos(alpha_k - alpha_l) Omega_k Omega_l, the potential energy
/// -sum_k g_k cos(alpha_k), and Lagrange's equations read M = S' [D_kl cos(alpha_k - alpha_l)] S,
/// N w = S' [sum_l D_kl sin(alpha_k - alpha_l) Omega_l^2] + diag(f) w, G = S' [g_k sin alpha_k].
///
/// Source: Lagrange's equations; the three-link arm of Dehak 2022 (Example I.4) is the instance n = 3, with the
/// misprints of its m11 and z4 corrected.
class SerialArm final : public Plant {
 public:
  using JointVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxJoints, 1>;
  using JointMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxJoints>;

  /// INIT-ONLY. Throws InputError like check_serial_arm().
  explicit SerialArm(SerialArmParameters parameters);

  const SerialArmParameters& parameters() const noexcept { return parameters_; }

  int joints() const noexcept override { return joints_; }
  int size() const noexcept override { return 2 * joints_; }
  Eigen::VectorXd initial_state(const JointArray& angle, const JointArray& speed) const override;
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override;
  void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept override;
  void derivative(double t, ConstVector y, Vector y_dot) const override;
  PlantSample sample(double t, ConstVector y) const override;

  /// M(theta), kg m^2, shape [n x n], symmetric positive definite. `angle`: shape [n], rad.
  JointMatrix mass_matrix(ConstVector angle) const;

  /// Torque of the motion itself, M(theta) acceleration + N(theta, speed) speed + G(theta), N m, shape [n] (the
  /// recursive Newton-Euler answer). All arguments have shape [n].
  JointVector inverse_dynamics(ConstVector angle, ConstVector speed, ConstVector acceleration) const;

  /// Kinetic plus potential energy, J; the potential is zero when every link is horizontal.
  double energy(ConstVector angle, ConstVector speed) const;

 private:
  struct Posture;  // sines and cosines of the absolute angles
  Posture posture(ConstVector angle) const noexcept;
  JointVector inverse_dynamics(const Posture& posture, ConstVector speed, ConstVector acceleration) const noexcept;
  JointMatrix mass_matrix(const Posture& posture) const noexcept;
  JointVector applied_torque(double t) const noexcept;

  SerialArmParameters parameters_;
  int joints_;
  JointMatrix coupling_;        // D, kg m^2
  JointVector gravity_moment_;  // g_k, N m
  JointVector friction_;        // f, N m s
};

}  // namespace quasilpv
