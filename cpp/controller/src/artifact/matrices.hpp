// Matrices of an artifact that must be symmetric and positive definite, and values per joint.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <string>

#include "document/field.hpp"
#include "quasilpv/block_polytope.hpp"
#include "quasilpv/kinematic_tree.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// A design inertia: symmetric vertices, positive definite at the centre. INIT-ONLY, as all here. Throws InputError.
BlockPolytope read_inertia(const Field& field, int joints);

/// A design inertia as a chain of bodies, one per joint. \param load what it carries for its gravity only; null:
/// nothing.
std::shared_ptr<const TreeDynamics> read_design_tree(const Field& field, int joints, const Field* load = nullptr);

/// P of size x size, symmetric and positive definite. Throws InputError.
Eigen::MatrixXd read_lyapunov(const Field& field, int size);

/// P of size x size by vertices, each symmetric and positive definite. Throws InputError.
BlockPolytope read_lyapunov_polytope(const Field& field, int size);

/// One interval per joint, the lower bound below the upper one. Throws InputError.
std::array<Interval, kMaxJoints> read_intervals(const Field& field, int joints);

/// One value per joint, each read by `read`. Throws InputError.
template <class Read>
JointArray read_joint_values(const Field& field, int joints, Read read) {
  if (field.size() != static_cast<std::size_t>(joints)) {
    field.fail("an array of " + std::to_string(field.size()), std::to_string(joints) + " values, one per joint");
  }
  JointArray values{};
  for (std::size_t j = 0; j < field.size(); ++j) {
    values[j] = read(field.at(j));
  }
  return values;
}

}  // namespace quasilpv
