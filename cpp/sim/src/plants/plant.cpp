#include "quasilpv/plant.hpp"

#include <cstddef>

namespace quasilpv {

Eigen::VectorXd ImplicitSystem::differential() const { return Eigen::VectorXd::Ones(size()); }

Eigen::VectorXd ImplicitSystem::absolute_tolerance(double tolerance) const {
  return Eigen::VectorXd::Constant(size(), tolerance);
}

// NOLINTNEXTLINE(performance-unnecessary-value-param): Eigen passes writable references by value.
void ImplicitSystem::make_consistent(double t, Vector y, Vector y_dot) const { derivative(t, y, y_dot); }

JointArray Plant::joint_torque(double t) const noexcept {
  JointArray torque = external_.at(t);
  for (std::size_t j = 0; j < torque.size(); ++j) {
    torque[j] += torque_[j];
  }
  return torque;
}

JointArray Plant::mobility(double t, ConstVector y) {
  const JointArray held = torque();
  set_torque({});
  const JointArray without = sample(t, y).driven_acceleration();
  JointArray mobility{};
  for (std::size_t j = 0; j < static_cast<std::size_t>(joints()); ++j) {
    JointArray unit{};
    unit[j] = 1.0;
    set_torque(unit);
    mobility[j] = sample(t, y).driven_acceleration()[j] - without[j];
  }
  set_torque(held);
  return mobility;
}

}  // namespace quasilpv
