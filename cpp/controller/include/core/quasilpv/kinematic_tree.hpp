// Robots in space as data: a chain of bodies, each carried by one joint.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "quasilpv/step.hpp"

namespace quasilpv {

class Field;

/// One joint and the body it carries. Frames stand at the joints; the body's inertia is about its joint's frame.
struct TreeJoint {
  std::string name;
  bool turns = true;              ///< false: slides along its axis, its coordinate is in m, its torque in N
  Eigen::Matrix3d rotation;       ///< of the frame at coordinate 0 in the frame before
  Eigen::Vector3d translation_m;  ///< of the frame at coordinate 0 in the frame before
  Eigen::Vector3d axis;           ///< unit vector in the joint's frame
  double mass_kg = 0.0;
  Eigen::Vector3d first_moment_kg_m;  ///< mass times centre of mass
  Eigen::Matrix3d rotational_kg_m2;   ///< about the frame's origin, symmetric
  double rotor_inertia_kg_m2 = 0.0;   ///< reflected to the joint
};

/// What the last body of a chain carries for the torque of gravity only.
struct GravityLoad {
  double mass_kg = 0.0;
  Eigen::Vector3d first_moment_kg_m = Eigen::Vector3d::Zero();  ///< in the last joint's frame
};

/// The chain, base to tip; 1 to 7 joints.
struct KinematicTree {
  std::vector<TreeJoint> joints;
  Eigen::Vector3d gravity_m_s2;  ///< in the axes of the base
  GravityLoad gravity_load = {};
};

/// The members `gravity_m_s2` and `joints` of a document of kind `tree`, strictly: rotations are rotations, axes have
/// length 1, inertias are not negative. Other members are left to the caller. INIT-ONLY. Throws InputError.
KinematicTree read_tree(const Field& field);

/// The same of a document that has no other members. INIT-ONLY. Throws InputError.
KinematicTree read_bare_tree(const Field& field);

/// The members `mass_kg` and `first_moment_kg_m` of a document, and no others. INIT-ONLY. Throws InputError.
GravityLoad read_gravity_load(const Field& field);

/// Angles or torques of all joints.
using TreeVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxJoints, 1>;
using TreeMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaxJoints, kMaxJoints>;

/// The motion of a tree: sweeps of fixed size over its joints, in the joints' own frames (Featherstone 2008, chapters 5
/// and 6). Coordinates, speeds and accelerations have n entries, in rad and s (m for a joint that slides). All member
/// functions are RT-SAFE (bounded, no allocation, no lock, no throw).
class TreeDynamics {
 public:
  /// INIT-ONLY.
  explicit TreeDynamics(const KinematicTree& tree);

  int joints() const noexcept { return joints_; }

  /// M(q) acceleration + G(q), N m: the torque of an acceleration from rest.
  void torque_at_rest(const double* q, const double* acceleration, double* torque) const noexcept;

  /// M(q) acceleration + h(q, speed), N m, h the torque of Coriolis, centrifugal and gravity forces.
  void inverse_dynamics(const double* q, const double* speed, const double* acceleration,
                        double* torque) const noexcept;

  /// M(q), kg m^2, n x n, both triangles.
  TreeMatrix inertia(const double* q) const noexcept;

  /// The derivatives of inverse_dynamics() with respect to q and to speed, both n x n, in one sweep of dual numbers.
  /// Not for the control thread: about as long as fifteen sweeps.
  void derivatives(const double* q, const double* speed, const double* acceleration, TreeMatrix& by_coordinate,
                   TreeMatrix& by_speed) const noexcept;

  /// Kinetic energy plus potential energy, J; the latter is 0 with every centre of mass in the base's origin.
  double energy(const double* q, const double* speed) const noexcept;

 private:
  friend struct TreeSweep;

  struct Joint {
    bool turns;
    Eigen::Matrix3d rotation_transposed;
    Eigen::Vector3d translation;
    Eigen::Vector3d axis;
    double mass;
    Eigen::Vector3d first_moment;
    Eigen::Matrix3d rotational;
    double rotor;
  };

  std::array<Joint, kMaxJoints> joint_;
  Eigen::Vector3d gravity_;
  GravityLoad load_;
  int joints_;
};

}  // namespace quasilpv
