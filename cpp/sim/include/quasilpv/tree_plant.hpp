// A robot in space as a plant.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "quasilpv/joint_friction.hpp"
#include "quasilpv/kinematic_tree.hpp"
#include "quasilpv/plant.hpp"

namespace quasilpv {

/// Physical parameters of a robot in space, its payload merged into the last body; 1 to 7 joints.
struct TreePlantParameters {
  std::string label;
  KinematicTree tree;
  std::vector<JointFriction> friction;  ///< one per joint
  double lag_s = 0.0;                   ///< time constant of the drives, >= 0, the same for all joints
};

/// The robot as a plant, y = (q, w): joint coordinates (rad; m for a joint that slides) and their rates; where the
/// drives lag y = (q, w, u), u the torque they deliver, which begins as what holds the robot. Where a joint sticks the
/// bristles of all joints come last.
///
///     q' - w = 0
///     M(q) w' + h(q, w) + friction - torque = 0,   torque = control + external, or u + external
///     lag u' + u - control = 0
///
/// M and h as in TreeDynamics. Source: Featherstone 2008, chapters 5 and 6.
class TreePlant final : public Plant {
 public:
  /// INIT-ONLY.
  explicit TreePlant(TreePlantParameters parameters);

  const TreePlantParameters& parameters() const noexcept { return parameters_; }
  const TreeDynamics& dynamics() const noexcept { return dynamics_; }

  int joints() const noexcept override { return dynamics_.joints(); }
  int size() const noexcept override { return (lags() ? 3 : 2) * dynamics_.joints() + friction_.bristles(); }
  Eigen::VectorXd absolute_tolerance(double tolerance) const override;
  Eigen::VectorXd initial_state(const JointArray& angle, const JointArray& speed) const override;
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override;
  void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept override;
  void derivative(double t, ConstVector y, Vector y_dot) const override;
  PlantSample sample(double t, ConstVector y) const override;
  JointArray mobility(double t, ConstVector y) override;

 private:
  bool lags() const noexcept { return parameters_.lag_s > 0.0; }
  /// What acts on the joints: from the drives and from outside, N m.
  TreeVector acting_torque(double t, ConstVector y) const noexcept;

  TreePlantParameters parameters_;
  TreeDynamics dynamics_;
  PlantFriction friction_;
};

}  // namespace quasilpv
