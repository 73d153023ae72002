// A disc that rolls without slipping, held by a damper and a hardening spring.
#pragma once

#include <Eigen/Core>
#include <string>

#include "quasilpv/plant.hpp"

namespace quasilpv {

/// Physical parameters of the disc.
struct SpringDiscParameters {
  std::string label;
  double mass_kg = 0.0;                     ///< M > 0
  double radius_m = 0.0;                    ///< r > 0
  double inertia_kg_m2 = 0.0;               ///< J > 0, about the centre
  double inertia_uncertainty_per_kg = 0.0;  ///< delta >= 0: 1/J_delta = 1/J + delta/r^2
  double stiffness_n_m = 0.0;               ///< k1 >= 0
  double cubic_stiffness_n_m3 = 0.0;        ///< k2 >= 0
  double damping_n_s_m = 0.0;               ///< b >= 0
};

/// Checks parameters and names the first wrong one; `source` and `path` name the origin in the error. INIT-ONLY. Throws
/// InputError.
void check_spring_disc(const SpringDiscParameters& parameters, const std::string& source, const std::string& path);

/// The disc as a plant, y = (x1, x2, x3, lambda): position of the centre (m, spring relaxed at 0), its speed, the
/// angular speed of the disc, and the contact force (N). Its one joint is the disc itself, driven by the torque u:
/// joint angle x1 / r, joint speed x3.
///
///     x1' - x2 = 0,    M x2' + k1 x1 + k2 x1^3 + b x2 - lambda = 0,    J_delta x3' + r lambda - u = 0,
///     (1/M + r^2/J_delta) lambda - (k1 x1 + k2 x1^3 + b x2)/M - (r/J_delta) u = 0
///
/// The last row is the time derivative of the rolling condition 0 = x2 - r x3, which has index 2; it determines lambda
/// everywhere. slip() is the monitor: the rolling condition is a linear invariant of this form.
///
/// Source: Arceo et al. 2019; Dehak 2022 (III.33) with the signs of its uncertain terms corrected.
class SpringDisc final : public Plant {
 public:
  /// INIT-ONLY. Throws InputError like check_spring_disc().
  explicit SpringDisc(SpringDiscParameters parameters);

  const SpringDiscParameters& parameters() const noexcept { return parameters_; }

  int joints() const noexcept override { return 1; }
  int size() const noexcept override { return 4; }
  Eigen::VectorXd differential() const override;
  Eigen::VectorXd absolute_tolerance(double tolerance) const override;
  Eigen::VectorXd initial_state(const JointArray& angle, const JointArray& speed) const override;
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override;
  void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept override;
  void derivative(double t, ConstVector y, Vector y_dot) const override;
  /// Projects the speeds onto x2 = r x3, orthogonally in the metric of the kinetic energy.
  void make_consistent(double t, Vector y, Vector y_dot) const override;
  PlantSample sample(double t, ConstVector y) const override;

  /// x2 - r x3, m/s: 0 while the disc rolls.
  double slip(ConstVector y) const noexcept { return y[1] - parameters_.radius_m * y[2]; }

 private:
  double spring_and_damper_force(double position, double speed) const noexcept;
  double contact_force(double t, ConstVector y) const noexcept;

  SpringDiscParameters parameters_;
  double inertia_;   // J_delta, kg m^2
  double mobility_;  // 1/M + r^2/J_delta, 1/kg
};

}  // namespace quasilpv
