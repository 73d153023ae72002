// The one interface of every plant: an implicit differential-algebraic equation F(t, y, y') = 0.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <utility>

#include "quasilpv/external_torque.hpp"
#include "quasilpv/plant_sample.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// A mechanical system under joint torques, as integrators see it:
///
///     F(t, y, y') = 0,   y = (differential components, algebraic components)
///
/// The joint torque is the held control torque plus the external torque, which is continuous and is evaluated at t.
/// A plant without algebraic components is an ordinary differential equation in disguise; constrained mechanisms add
/// multipliers as algebraic components and override make_consistent(). Integrators hold a reference to the plant and
/// never change it. All functions of t and y are RT-UNSAFE unless they say otherwise.
class Plant {
 public:
  using ConstVector = const Eigen::Ref<const Eigen::VectorXd>&;  // Eigen's idiom for a read-only argument
  using Vector = Eigen::Ref<Eigen::VectorXd>;
  using Matrix = Eigen::Ref<Eigen::MatrixXd>;

  Plant() = default;
  virtual ~Plant() = default;
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;

  virtual int joints() const noexcept = 0;  ///< actuated and measured joints, n
  virtual int size() const noexcept = 0;    ///< components of y

  /// 1 for a differential component, 0 for an algebraic one; shape [size]. Default: all differential.
  virtual Eigen::VectorXd differential() const;

  /// Absolute tolerance of each component; shape [size]. `tolerance` is the one the scenario asks for: angles and
  /// speeds take it as it is (default), multipliers, which are forces, override it.
  virtual Eigen::VectorXd absolute_tolerance(double tolerance) const;

  /// y for the given joint angles (rad) and speeds (rad/s); the entries of the first joints() joints are read.
  /// Throws PlantError if the mechanism cannot be assembled there.
  virtual Eigen::VectorXd initial_state(const JointArray& angle, const JointArray& speed) const = 0;

  /// F(t, y, y') into `residual`; all vectors have shape [size]. A configuration where F is not defined yields NaN.
  virtual void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept = 0;

  /// c_j dF/dy' + dF/dy into `jacobian`, shape [size x size]: the iteration matrix of implicit multistep methods.
  virtual void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept = 0;

  /// The explicit form: y' of the differential components from one solution of the equations of motion, multipliers
  /// included, and 0 for the algebraic components, which are not read. Throws PlantError where there is no solution: a
  /// singular mass matrix or configuration.
  virtual void derivative(double t, ConstVector y, Vector y_dot) const = 0;

  /// Makes (y, y') satisfy F = 0 and the hidden constraints, as an integrator needs it after a jump of the torque.
  /// Default: y is left alone, y' = derivative(t, y). Throws PlantError like derivative().
  virtual void make_consistent(double t, Vector y, Vector y_dot) const;

  /// The actuated joints at (t, y); the acceleration is the one the torque in force produces. Throws PlantError like
  /// derivative().
  virtual PlantSample sample(double t, ConstVector y) const = 0;

  /// Control torque (N m) in force from now on.
  void set_torque(const JointArray& torque) noexcept { torque_ = torque; }
  const JointArray& torque() const noexcept { return torque_; }

  void set_external_torque(ExternalTorque external) { external_ = std::move(external); }
  const ExternalTorque& external_torque() const noexcept { return external_; }

 protected:
  /// Held control torque + external torque at t, N m. RT-SAFE (bounded, no allocation, no lock, no throw).
  JointArray joint_torque(double t) const noexcept;

 private:
  JointArray torque_{};
  ExternalTorque external_;
};

/// Makes one plant, at rest under no torque, as often as it is called. Throws InputError.
using PlantFactory = std::function<std::unique_ptr<Plant>()>;

}  // namespace quasilpv
