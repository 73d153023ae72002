// What integrators see of anything: an implicit differential-algebraic equation F(t, y, y') = 0.
#pragma once

#include <Eigen/Core>

namespace quasilpv {

/// F(t, y, y') = 0, y = (differential components, algebraic components). One without algebraic components is an
/// ordinary differential equation in disguise. Integrators hold a reference and never change it. All functions of t and
/// y are RT-UNSAFE unless they say otherwise.
class ImplicitSystem {
 public:
  using ConstVector = const Eigen::Ref<const Eigen::VectorXd>&;  // Eigen's idiom for a read-only argument
  using Vector = Eigen::Ref<Eigen::VectorXd>;
  using Matrix = Eigen::Ref<Eigen::MatrixXd>;

  ImplicitSystem() = default;
  virtual ~ImplicitSystem() = default;
  ImplicitSystem(const ImplicitSystem&) = delete;
  ImplicitSystem& operator=(const ImplicitSystem&) = delete;

  virtual int size() const noexcept = 0;  ///< components of y

  /// 1 for a differential component, 0 for an algebraic one; shape [size]. Default: all differential.
  virtual Eigen::VectorXd differential() const;

  /// Absolute tolerance of each component; shape [size]. `tolerance` is the one that is asked for: most components take
  /// it as it is (default), multipliers, which are forces, override it.
  virtual Eigen::VectorXd absolute_tolerance(double tolerance) const;

  /// F(t, y, y') into `residual`; all vectors have shape [size]. A configuration where F is not defined yields NaN.
  virtual void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept = 0;

  /// c_j dF/dy' + dF/dy into `jacobian`, shape [size x size]: the iteration matrix of implicit multistep methods.
  virtual void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept = 0;

  /// The explicit form: y' of the differential components from one solution of the equations, algebraic components
  /// included, and 0 for those, which are not read. Throws PlantError where there is no solution.
  virtual void derivative(double t, ConstVector y, Vector y_dot) const = 0;

  /// Makes (y, y') satisfy F = 0 and the hidden constraints, as an integrator needs it after a jump of the input.
  /// Default: y is left alone, y' = derivative(t, y). Throws PlantError like derivative().
  virtual void make_consistent(double t, Vector y, Vector y_dot) const;
};

}  // namespace quasilpv
