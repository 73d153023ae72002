// What laws for elastic joints feed forward along a reference: the dynamics of the links, the friction of the motors.
#pragma once

#include <memory>

#include "laws/common/law_support.hpp"
#include "laws/common/law_table.hpp"

namespace quasilpv {

/// Inverse dynamics of a chain of bodies, and f w + c tanh(w / w_0).
template <int N>
class LinkFeedforward {
 public:
  /// `model` is a chain (require_chain); f N m s/rad and c N m, as far as they are known.
  LinkFeedforward(const DesignModel& model, const JointArray& viscous, const JointArray& coulomb)
      : tree_(model.tree), viscous_(from_array<N>(viscous)), coulomb_(from_array<N>(coulomb)) {}

  JointVector<N> dynamics(const ReferenceVectors<N>& reference) const noexcept {
    JointVector<N> torque;
    tree_->inverse_dynamics(reference.angle.data(), reference.speed.data(), reference.acceleration.data(),
                            torque.data());
    return torque;
  }

  JointVector<N> friction(const JointVector<N>& speed) const noexcept {
    return viscous_.cwiseProduct(speed) + coulomb_.cwiseProduct((speed / kCoulombSpeed).array().tanh().matrix());
  }

 private:
  static constexpr double kCoulombSpeed = 0.01;  // w_0, rad/s: not at once where the reference turns

  std::shared_ptr<const TreeDynamics> tree_;
  JointVector<N> viscous_;
  JointVector<N> coulomb_;
};

/// Refuses a table of the inertia where a chain is fed forward.
template <typename Parameters>
void require_chain(const Field& law, Parameters& parameters) {
  if (!parameters.model.tree) {
    law["inertia"].fail("a table", "a chain of bodies, whose inverse dynamics is fed forward");
  }
}

}  // namespace quasilpv
