// What the loop needs to know of a law, whatever its kind.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>

#include "quasilpv/block_polytope.hpp"
#include "quasilpv/control_law.hpp"
#include "quasilpv/kinematic_tree.hpp"
#include "quasilpv/program.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// What every law knows of the robot, M_n in kg m^2 and G in N m: a table M_n(z) over premises z(y) and a program G(y),
/// or a chain of bodies, of which one recursion gives both.
struct DesignModel {
  Program premises;
  BlockPolytope inertia;
  Program gravity;
  std::shared_ptr<const TreeDynamics> tree;  ///< null: the three before, which are empty otherwise

  /// G(y). RT-SAFE (bounded, no allocation, no lock, no throw). \param[out] torque one value per joint.
  void gravity_at(const double* angle, double* torque) const noexcept {
    if (tree) {
      const JointArray none{};
      tree->torque_at_rest(angle, none.data(), torque);
    } else {
      gravity.evaluate(ProgramInput{angle}, torque);
    }
  }
};

/// A proved lower bound of the Lyapunov function of a moving robot (docs/concepts/motion.md), rad^2: the trace of
/// `joints` Z' `signals` Z. The rows of Z, one column per joint, are what is known of the loop, all in rad: the angle
/// error y - r, the innovation, T (w - r'), T^2 (d - d_f) and e_I / T.
struct LyapunovBound {
  static constexpr int kSignals = 5;
  Eigen::Matrix<double, kSignals, kSignals> signals;     ///< symmetric positive definite
  Eigen::Matrix<double, kMaxJoints, kMaxJoints> joints;  ///< the same; zero from the number of joints on
  double innovation_share = 1.0;                         ///< what the correction leaves of the innovation, != 0: 1 - l1
};

/// Angles, rad, and largest speeds, rad/s, of the motions that a law was designed for (docs/concepts/motion.md);
/// entries from the number of joints on are unused.
struct MotionLimits {
  std::array<Interval, kMaxJoints> angle_rad{};
  JointArray speed_rad_s{};
};

/// The parameters of a law, read from an artifact and never changed. Each kind of law is a class of its own, in one
/// file of `src/laws` that nobody else includes; the registry beside them names all kinds.
class LawParameters {
 public:
  virtual ~LawParameters() = default;
  LawParameters& operator=(const LawParameters&) = delete;

  DesignModel model;

  /// Whether the law reads measured speeds.
  virtual bool reads_speed() const noexcept = 0;
  /// Which angles the law controls. A law with a side reads no speeds: those of a reading are of `angle_rad`.
  virtual AngleSide controlled_side() const noexcept { return AngleSide::kJoint; }
  /// The Coriolis torque that the law feeds forward, as the law defines it; null: none.
  virtual const Program* coriolis() const noexcept { return nullptr; }
  /// What the monitor watches; null: the law was not designed for one.
  virtual const LyapunovBound* lyapunov_bound() const noexcept { return nullptr; }
  /// Beyond which motions the law's proof says nothing; null: its proof does not depend on the motion.
  virtual const MotionLimits* motion_limits() const noexcept { return nullptr; }

  /// The law with these parameters, at its beginning. Dispatches once on the number of joints. INIT-ONLY.
  virtual std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const = 0;

 protected:
  LawParameters() = default;
  LawParameters(const LawParameters&) = default;
};

}  // namespace quasilpv
