// A robot in space whose gears give, as a plant.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "quasilpv/kinematic_tree.hpp"
#include "quasilpv/plant.hpp"
#include "quasilpv/tree_plant.hpp"

namespace quasilpv {

/// The gear of one joint: spring and damper between motor and link.
struct ElasticGear {
  double stiffness_nm_rad = 0.0;     ///< K > 0
  double damping_nm_s = 0.0;         ///< D >= 0
  double rotor_inertia_kg_m2 = 0.0;  ///< B > 0, reflected to the joint
};

/// A drive that controls the torque in its joint: its motor's torque follows s (command - sensed) + sensed, sensed the
/// spring's torque as its sensor says it, so that the link feels a rotor of B / s. Gain 1 is none.
struct TorqueLoop {
  double gain = 1.0;   ///< s >= 1
  double lag_s = 0.0;  ///< time constant with which the motor's torque follows, >= 0; 0: an ideal drive
};

/// Physical parameters, the payload merged into the last body; 1 to 7 joints.
struct ElasticTreeParameters {
  std::string label;
  KinematicTree tree;                   ///< links only: its rotor inertias are 0
  std::vector<ElasticGear> gears;       ///< one per joint
  std::vector<JointFriction> friction;  ///< of the motors, one per joint
  std::uint32_t sensors = kMotorAngle;  ///< GearSensor bits; encoders on one side at least
  JointArray torque_noise_nm{};         ///< of the torque sensors, see MotorSample
  JointArray torque_quantum_nm{};       ///< likewise
  TorqueLoop torque_loop{};             ///< the same in all joints
};

/// The robot as a plant, y = (q, th, w, v): joint angles, motor angles reflected to the joints, and their rates; where
/// drives lag then u, the motors' torques, which begin as what holds the robot; where a joint sticks then its bristles.
///
///     q' - w = 0,   th' - v = 0
///     M(q) w' + h(q, w) - spring - external torque = 0,   spring = K (th - q) + D (v - w)
///     B v' + friction + spring - u = 0
///     lag u' + u - s control - (1 - s) (spring + error) = 0       without lag an equation that gives u
///
/// `error` is that of the torque sensors, held over a sample: set_torque_error(). M and h of the links alone, as in
/// TreeDynamics; rotors turn about their joints only. It begins with the springs carrying the weight. Source: Spong
/// 1987, Modeling and control of elastic joint robots.
class ElasticTreePlant final : public Plant {
 public:
  /// INIT-ONLY.
  explicit ElasticTreePlant(ElasticTreeParameters parameters);

  const ElasticTreeParameters& parameters() const noexcept { return parameters_; }

  int joints() const noexcept override { return dynamics_.joints(); }
  int size() const noexcept override { return (lags() ? 5 : 4) * dynamics_.joints() + friction_.bristles(); }
  Eigen::VectorXd absolute_tolerance(double tolerance) const override;
  Eigen::VectorXd initial_state(const JointArray& angle, const JointArray& speed) const override;
  void residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept override;
  void jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept override;
  void derivative(double t, ConstVector y, Vector y_dot) const override;
  PlantSample sample(double t, ConstVector y) const override;
  JointArray mobility(double t, ConstVector y) override;

  /// Kinetic, gravity's, the springs' and the bristles' energy, J; see TreeDynamics::energy().
  double energy(ConstVector y) const;

 private:
  /// K (th - q) + D (v - w), N m.
  TreeVector spring_torque(ConstVector y) const noexcept;
  bool lags() const noexcept { return parameters_.torque_loop.lag_s > 0.0; }
  /// What the drives' torques follow, N m.
  TreeVector wanted_torque(const TreeVector& spring) const noexcept;

  ElasticTreeParameters parameters_;
  TreeDynamics dynamics_;
  TreeVector stiffness_;
  TreeVector damping_;
  TreeVector rotor_;
  PlantFriction friction_;
};

}  // namespace quasilpv
