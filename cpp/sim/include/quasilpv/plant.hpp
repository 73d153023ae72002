// The one interface of every robot's plant: an implicit differential-algebraic equation under joint torques.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <utility>

#include "quasilpv/external_torque.hpp"
#include "quasilpv/implicit_system.hpp"
#include "quasilpv/plant_sample.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// A mechanical system under joint torques.
///
/// The joint torque is the held control torque plus the external torque, which is continuous and is evaluated at t.
/// Constrained mechanisms add multipliers as algebraic components and override make_consistent().
class Plant : public ImplicitSystem {
 public:
  virtual int joints() const noexcept = 0;  ///< actuated and measured joints, n

  /// y for the given joint angles (rad) and speeds (rad/s); the entries of the first joints() joints are read.
  /// Throws PlantError if the mechanism cannot be assembled there.
  virtual Eigen::VectorXd initial_state(const JointArray& angle, const JointArray& speed) const = 0;

  /// The actuated joints at (t, y); the acceleration is the one the torque in force produces. Throws PlantError like
  /// derivative().
  virtual PlantSample sample(double t, ConstVector y) const = 0;

  /// By how much a torque accelerates what it pushes, per joint, 1/(kg m^2): of drives that lag, once they have
  /// followed. Default: sample() with a unit torque less sample() without one. Throws PlantError like sample().
  virtual JointArray mobility(double t, ConstVector y);

  /// Control torque (N m) in force from now on.
  void set_torque(const JointArray& torque) noexcept { torque_ = torque; }
  const JointArray& torque() const noexcept { return torque_; }

  /// By how much the torque sensors of the joints err from now on, N m: drives that control these torques follow them.
  void set_torque_error(const JointArray& error) noexcept { torque_error_ = error; }

  void set_external_torque(ExternalTorque external) { external_ = std::move(external); }
  const ExternalTorque& external_torque() const noexcept { return external_; }

 protected:
  /// Held control torque + external torque at t, N m. RT-SAFE (bounded, no allocation, no lock, no throw).
  JointArray joint_torque(double t) const noexcept;

  const JointArray& torque_error() const noexcept { return torque_error_; }

 private:
  JointArray torque_{};
  JointArray torque_error_{};
  ExternalTorque external_;
};

/// Makes one plant, at rest under no torque, as often as it is called. Throws InputError.
using PlantFactory = std::function<std::unique_ptr<Plant>()>;

}  // namespace quasilpv
