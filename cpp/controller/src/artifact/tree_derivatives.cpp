// Derivatives of the sweep by dual numbers: a translation unit of its own, because they take long to compile.
#include <Eigen/Core>
#include <array>
// clang-format off: it needs Eigen/Core before it
#include <unsupported/Eigen/AutoDiff>
// clang-format on

#include "artifact/tree_sweep.hpp"
#include "quasilpv/kinematic_tree.hpp"

namespace quasilpv {

void TreeDynamics::derivatives(const double* q, const double* speed, const double* acceleration,
                               TreeMatrix& by_coordinate, TreeMatrix& by_speed) const noexcept {
  constexpr int kDirections = 2 * kMaxJoints;
  using Directions = Eigen::Matrix<double, kDirections, 1>;
  using Dual = Eigen::AutoDiffScalar<Directions>;
  std::array<Dual, kMaxJoints> at;
  std::array<Dual, kMaxJoints> w;
  std::array<Dual, kMaxJoints> a;
  std::array<Dual, kMaxJoints> torque;
  for (int k = 0; k < joints_; ++k) {
    const auto place = static_cast<std::size_t>(k);
    at[place] = Dual(q[k], Directions::Unit(k));
    w[place] = Dual(speed[k], Directions::Unit(kMaxJoints + k));
    a[place] = Dual(acceleration[k], Directions::Zero());
  }
  TreeSweep::inverse_dynamics<Dual>(*this, at.data(), w.data(), a.data(), torque.data());
  by_coordinate.resize(joints_, joints_);
  by_speed.resize(joints_, joints_);
  for (int k = 0; k < joints_; ++k) {
    const Directions& derivatives = torque[static_cast<std::size_t>(k)].derivatives();
    by_coordinate.row(k) = derivatives.head(joints_).transpose();
    by_speed.row(k) = derivatives.segment(kMaxJoints, joints_).transpose();
  }
}

}  // namespace quasilpv
