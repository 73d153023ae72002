// Planar five-bar mechanism: two equal legs whose ends are pinned together.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

#include "quasilpv/planar_link.hpp"
#include "quasilpv/plant.hpp"

namespace quasilpv {

/// How the closed chain is written as a differential-algebraic equation.
enum class FiveBarFormulation {
  kIndex1,  ///< the twice differentiated constraint with Baumgarte's stabilisation
  kGgl,     ///< the constraint and its derivative with Gear, Gupta and Leimkuhler's second multiplier, index 2
};

/// Physical parameters of a five-bar. Each leg is an active link, driven at the common motor axis, and a passive link
/// from the elbow to the tool.
struct FiveBarParameters {
  std::string label;
  double gravity_m_s2 = 9.81;               ///< g; a leg at angle 0 hangs for g > 0
  PlanarLink active;                        ///< a, m_a, r_a, I_a, f_a
  PlanarLink passive;                       ///< b, m_b, r_b, I_b, f_b; friction of the elbow
  double spring_nm_rad = 0.0;               ///< k >= 0, torsion springs on the motor axis
  std::array<double, 2> spring_rest_rad{};  ///< active angles at which they are relaxed
  FiveBarFormulation formulation = FiveBarFormulation::kIndex1;
  double baumgarte_per_s = 50.0;  ///< alpha >= 0; GGL uses it in the explicit form only
};

/// Checks parameters and names the first wrong one. The parallel axis bound of both links makes the mass matrix
/// positive definite at every posture. `source` and `path` name the origin in the error. INIT-ONLY. Throws InputError.
void check_five_bar(const FiveBarParameters& parameters, const std::string& source, const std::string& path);

/// The five-bar as a plant in absolute angles from the downward vertical, phi = (th_1, th_2, q_1, q_2), with
/// v = phi', the constraint force lambda (N) in the tool pin and, in the GGL form, a multiplier mu that is zero on
/// solutions. The actuated joints are th_1 and th_2.
///
///     y = (phi, v, lambda)        phi' - v = 0,           dynamics = 0,  J v' + gamma + 2 alpha J v + alpha^2 h = 0
///     y = (phi, v, lambda, mu)    phi' - v - J' mu = 0,   dynamics = 0,  J v = 0,  h = 0
///
///     dynamics = M v' + N v + G + friction + springs - (torque, 0) - J' lambda
///     M = [c4 1, c3 diag cos d; ., c5 1],   d_i = q_i - th_i,   c3 = m_b r_b a,  c4 = I_a + m_b a^2,  c5 = I_b
///     N v = (-c3 q_i'^2 sin d_i, +c3 th_i'^2 sin d_i),   G = (c1 sin th_i, c2 sin q_i),
///     c1 = g (m_a r_a + m_b a),   c2 = g m_b r_b
///     h = a (cos th_1 - cos th_2, sin th_1 - sin th_2) + b (cos q_1 - cos q_2, sin q_1 - sin q_2)
///     J = dh/dphi,   gamma = (dJ/dt) v,   tool at (a sin th_i + b sin q_i, -a cos th_i - b cos q_i)
///
/// The multipliers are determined only while the passive links are not in line: sin(q_1 - q_2) >= 0.05 is demanded at
/// every start of an integration and at every sample, and the residual is NaN where it is not positive. It is positive
/// in the assembly mode th_1 < th_2 with the tool on the far side of the elbows, the only one this class builds.
///
/// Sources: Lagrange's equations; Dehak 2022 (IV.5.2), whose moments of inertia are about the joint axes; Baumgarte,
/// Comp. Meth. Appl. Mech. Eng. 1, 1972; Gear, Leimkuhler and Gupta, J. Comp. Appl. Math. 12, 1985.
class FiveBar final : public Plant {
 public:
  using Coordinates = Eigen::Vector4d;  ///< in the order (th_1, th_2, q_1, q_2)
  using ConstraintJacobian = Eigen::Matrix<double, 2, 4>;

  /// INIT-ONLY. Throws InputError like check_five_bar().
  explicit FiveBar(FiveBarParameters parameters);

  const FiveBarParameters& parameters() const noexcept { return parameters_; }

  int joints() const noexcept override { return 2; }
  int size() const noexcept override { return parameters_.formulation == FiveBarFormulation::kIndex1 ? 10 : 12; }
  Eigen::VectorXd differential() const override;
  /// 1 for the multipliers, whatever is asked: they are forces, and Newton's method sees h divided by the step.
  Eigen::VectorXd absolute_tolerance(double tolerance) const override;
  /// Passive angles and speeds by forward kinematics. Throws PlantError unless 0 < th_2 - th_1 < pi and the passive
  /// links reach each other, and like derivative().
  Eigen::VectorXd initial_state(const JointArray& angle, const JointArray& speed) const override;
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override;
  void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept override;
  /// From one solution of the equations of motion with the multipliers (KKT). Throws PlantError near singularities.
  void derivative(double t, ConstVector y, Vector y_dot) const override;
  /// Projects phi onto h = 0 and v onto J v = 0, both orthogonally in the metric M, then derivative() with the
  /// multipliers that belong to it. Throws PlantError like derivative() or if phi is too far from h = 0.
  void make_consistent(double t, Vector y, Vector y_dot) const override;
  PlantSample sample(double t, ConstVector y) const override;

  /// M(phi), kg m^2, symmetric positive definite.
  Eigen::Matrix4d mass_matrix(const Coordinates& phi) const noexcept;
  /// M acceleration + N v + G + friction + springs, N m: the torque on each link without its constraint.
  Coordinates inverse_dynamics(const Coordinates& phi, const Coordinates& v,
                               const Coordinates& acceleration) const noexcept;
  /// h(phi), m: 0 when the legs meet.
  Eigen::Vector2d constraint(const Coordinates& phi) const noexcept;
  /// J(phi), m.
  ConstraintJacobian constraint_jacobian(const Coordinates& phi) const noexcept;
  /// Kinetic plus potential energy, J; the potential is zero with horizontal links and relaxed springs.
  double energy(const Coordinates& phi, const Coordinates& v) const noexcept;

 private:
  struct Posture;  // sines, cosines, and the links as vectors
  struct Motion {
    Coordinates acceleration;
    Eigen::Vector2d multiplier;
  };

  Posture posture(const Coordinates& phi) const noexcept;
  Eigen::Matrix4d mass_matrix(const Posture& at) const noexcept;
  Eigen::Matrix4d inverse_mass_matrix(const Posture& at) const noexcept;
  Coordinates inverse_dynamics(const Posture& at, const Coordinates& phi, const Coordinates& v,
                               const Coordinates& acceleration) const noexcept;
  Coordinates applied_torque(double t) const noexcept;
  void dynamics_jacobian(const Posture& at, double c_j, ConstVector y, ConstVector y_dot,
                         Matrix jacobian) const noexcept;
  Motion motion(double t, const Posture& at, const Coordinates& phi, const Coordinates& v) const noexcept;
  Coordinates project_angles(double t, Coordinates phi) const;
  void require_regular(double t, const Posture& at) const;

  FiveBarParameters parameters_;
  double gravity_active_, gravity_passive_;             // c1, c2
  double coupling_, inertia_active_, inertia_passive_;  // c3, c4, c5
};

}  // namespace quasilpv
