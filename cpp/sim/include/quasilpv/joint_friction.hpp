// Friction of joints: smoothed, or with stick and slip.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "quasilpv/kinematic_tree.hpp"
#include "quasilpv/plant.hpp"

namespace quasilpv {

/// Friction of one joint, N m, of its speed w: viscous f w, and Coulomb friction c.
///
/// *Smoothed* (no break-away torque): f w + c tanh(w / w0). Below w0 the joint creeps.
///
/// *With stick and slip*: the joint hangs on a bristle with the deflection b, in units of the largest one of a joint at
/// rest, z0; s the break-away torque, so that s / z0 is the bristle's stiffness:
///
///     torque = s b + d(w) z0 b' + f w,    d(w) = d / (1 + d |w| / (4 c))
///     z0 b'  = w (1 - a(r) r),            r = s b sign(w) / g(w),    g(w) = c + (s - c) exp(-(w / w_s)^2)
///     a(r)   = 0 up to r = 0.8, 1 from r = 1 on, a half wave of the sine between
///
/// Up to 0.8 s the bristle is a spring: the joint stays where it is whatever the torque does, and comes back. It slides
/// at the torque c + f w. With this d(w) no motion gets energy out of the bristle, whatever s / c is. Source: Canudas
/// de Wit, Olsson, Astrom and Lischinsky 1995, A new model for control of systems with friction; the share a(r),
/// without which the bristle creeps under a torque that dithers: Dupont, Hayward, Armstrong and Altpeter 2002, Single
/// state elastoplastic friction models.
struct JointFriction {
  double viscous_nm_s = 0.0;             ///< f >= 0
  double coulomb_nm = 0.0;               ///< c >= 0, > 0 with stick and slip
  double coulomb_speed_rad_s = 1e-3;     ///< w0 > 0
  double breakaway_nm = 0.0;             ///< s >= c; 0: smoothed
  double stribeck_speed_rad_s = 1e-2;    ///< w_s > 0
  double presliding_rad = 1e-5;          ///< z0 > 0
  double presliding_damping_nm_s = 0.0;  ///< d >= 0

  bool sticks() const noexcept { return breakaway_nm > 0.0; }

  /// N m against the motion; b is not read where nothing sticks. RT-SAFE (bounded, no allocation, no lock, no throw),
  /// as all that follow.
  double torque(double speed, double bristle) const noexcept;

  /// b', 1/s; 0 where nothing sticks.
  double bristle_rate(double speed, double bristle) const noexcept;

  /// Energy in the bristle, J.
  double bristle_energy(double bristle) const noexcept;

  /// Partial derivatives of torque and bristle_rate.
  struct Slopes {
    double torque_by_speed = 0.0;
    double torque_by_bristle = 0.0;
    double rate_by_speed = 0.0;
    double rate_by_bristle = 0.0;
  };
  Slopes slopes(double speed, double bristle) const noexcept;
};

/// The friction of all joints of a plant: the speeds begin at `speed` in its state, and where a joint sticks a bristle
/// per joint at `bristle`.
class PlantFriction {
 public:
  PlantFriction(std::vector<JointFriction> friction, int speed, int bristle);

  /// Entries of the state that hold bristles.
  int bristles() const noexcept { return sticks_ ? joints() : 0; }

  /// N m. RT-SAFE (bounded, no allocation, no lock, no throw), as all that follow.
  TreeVector torque(Plant::ConstVector y) const noexcept;

  /// b' of all bristles.
  void bristle_rates(Plant::ConstVector y, Plant::Vector rates) const noexcept;

  /// Adds what the torques, in the rows from `force` on, and the bristles' own equations b' - rate = 0 contribute.
  void add_jacobian(Plant::ConstVector y, double c_j, Eigen::Index force, Plant::Matrix jacobian) const noexcept;

  /// In the bristles, J.
  double energy(Plant::ConstVector y) const noexcept;

  /// Bristles are counted in parts of their largest deflection, far more coarsely than angles in rad.
  void loosen(Eigen::VectorXd& tolerance) const noexcept;

 private:
  int joints() const noexcept { return static_cast<int>(friction_.size()); }
  const JointFriction& own(int k) const noexcept { return friction_[static_cast<std::size_t>(k)]; }
  double bristle_of(Plant::ConstVector y, int k) const noexcept { return sticks_ ? y[bristle_ + k] : 0.0; }

  std::vector<JointFriction> friction_;
  int speed_;
  int bristle_;
  bool sticks_;
};

}  // namespace quasilpv
