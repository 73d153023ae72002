// The recursive Newton-Euler sweep for any scalar: doubles, or dual numbers that carry derivatives.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "quasilpv/kinematic_tree.hpp"

namespace quasilpv {

template <class Scalar>
using Vector3 = Eigen::Matrix<Scalar, 3, 1>;
template <class Scalar>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

/// A twist or a wrench: (linear; angular) or (force; moment).
template <class Scalar>
struct Spatial {
  Vector3<Scalar> linear;
  Vector3<Scalar> angular;
};

/// Where a joint's frame is in the frame before: E = R' from the axes before to its own, and the place of its origin.
template <class Scalar>
struct Pose {
  Matrix3<Scalar> E;
  Vector3<Scalar> place;

  /// The twist of the frame from the twist of the frame before it.
  Spatial<Scalar> carry(const Spatial<Scalar>& before) const {
    return {E * (before.linear + before.angular.cross(place)), E * before.angular};
  }
  /// The wrench on the frame before from a wrench on this one.
  Spatial<Scalar> return_wrench(const Spatial<Scalar>& own) const {
    const Vector3<Scalar> force = E.transpose() * own.linear;
    return {force, E.transpose() * own.angular + place.cross(force)};
  }
};

struct TreeSweep {
  using Joint = TreeDynamics::Joint;

  static const Joint& joint(const TreeDynamics& tree, int k) { return tree.joint_[static_cast<std::size_t>(k)]; }
  static const Eigen::Vector3d& gravity(const TreeDynamics& tree) { return tree.gravity_; }
  static const GravityLoad& load(const TreeDynamics& tree) { return tree.load_; }

  template <class Scalar>
  static Pose<Scalar> pose(const Joint& joint, const Scalar& q) {
    using std::cos;
    using std::sin;
    const Vector3<Scalar> translation = joint.translation.template cast<Scalar>();
    const Matrix3<Scalar> fixed = joint.rotation_transposed.template cast<Scalar>();
    const Vector3<Scalar> axis = joint.axis.template cast<Scalar>();
    if (!joint.turns) {
      return {fixed, translation + fixed.transpose() * (axis * q)};
    }
    // R' = I - sin q [a] + (1 - cos q) [a]^2 applied to the columns of the fixed rotation.
    const Scalar sine = sin(q);
    const Scalar versine = Scalar(1.0) - cos(q);
    Matrix3<Scalar> E;
    for (int column = 0; column < 3; ++column) {
      const Vector3<Scalar> x = fixed.col(column);
      const Vector3<Scalar> turned = axis.cross(x);
      E.col(column) = x - sine * turned + versine * axis.cross(turned);
    }
    return {E, translation};
  }

  template <class Scalar>
  static Spatial<Scalar> momentum(const Joint& joint, const Spatial<Scalar>& v) {
    const Vector3<Scalar> first = joint.first_moment.template cast<Scalar>();
    return {v.linear * Scalar(joint.mass) + v.angular.cross(first),
            first.cross(v.linear) + joint.rotational.template cast<Scalar>() * v.angular};
  }

  /// M(q) a + h(q, w); without speeds (null) M(q) a + G(q).
  template <class Scalar>
  static void inverse_dynamics(const TreeDynamics& tree, const Scalar* q, const Scalar* w, const Scalar* a,
                               Scalar* torque) {
    const int n = tree.joints();
    std::array<Pose<Scalar>, kMaxJoints> poses;
    std::array<Spatial<Scalar>, kMaxJoints> wrenches;
    const Vector3<Scalar> none = Vector3<Scalar>::Constant(Scalar(0.0));
    Spatial<Scalar> v{none, none};
    Spatial<Scalar> acceleration{-gravity(tree).template cast<Scalar>(), none};
    for (int k = 0; k < n; ++k) {
      const Joint& own = joint(tree, k);
      const auto place = static_cast<std::size_t>(k);
      const Vector3<Scalar> axis = own.axis.template cast<Scalar>();
      poses[place] = pose(own, q[k]);
      acceleration = poses[place].carry(acceleration);
      (own.turns ? acceleration.angular : acceleration.linear) += axis * a[k];
      wrenches[place] = momentum(own, acceleration);
      if (w != nullptr) {
        v = poses[place].carry(v);
        const Vector3<Scalar> moved = axis * w[k];
        if (own.turns) {
          v.angular += moved;
          add(momentum(own, Spatial<Scalar>{v.linear.cross(moved), v.angular.cross(moved)}), wrenches[place]);
          acceleration.linear += v.linear.cross(moved);
          acceleration.angular += v.angular.cross(moved);
        } else {
          v.linear += moved;
          add(momentum(own, Spatial<Scalar>{v.angular.cross(moved), none}), wrenches[place]);
          acceleration.linear += v.angular.cross(moved);
        }
        const Spatial<Scalar> p = momentum(own, v);
        wrenches[place].linear += v.angular.cross(p.linear);
        wrenches[place].angular += v.angular.cross(p.angular) + v.linear.cross(p.linear);
      }
    }
    if (load(tree).mass_kg > 0.0) {
      Vector3<Scalar> up = -gravity(tree).template cast<Scalar>();
      for (int k = 0; k < n; ++k) {
        up = poses[static_cast<std::size_t>(k)].E * up;
      }
      const Vector3<Scalar> first = load(tree).first_moment_kg_m.template cast<Scalar>();
      add(Spatial<Scalar>{up * Scalar(load(tree).mass_kg), first.cross(up)}, wrenches[static_cast<std::size_t>(n - 1)]);
    }
    for (int k = n - 1; k >= 0; --k) {
      const Joint& own = joint(tree, k);
      const auto place = static_cast<std::size_t>(k);
      const Vector3<Scalar>& working = own.turns ? wrenches[place].angular : wrenches[place].linear;
      torque[k] = own.axis.template cast<Scalar>().dot(working) + Scalar(own.rotor) * a[k];
      if (k > 0) {
        add(poses[place].return_wrench(wrenches[place]), wrenches[place - 1]);
      }
    }
  }

 private:
  template <class Scalar>
  static void add(const Spatial<Scalar>& more, Spatial<Scalar>& sum) {
    sum.linear += more.linear;
    sum.angular += more.angular;
  }
};

}  // namespace quasilpv
