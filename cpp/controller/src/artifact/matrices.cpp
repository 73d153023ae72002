#include "artifact/matrices.hpp"

#include <Eigen/Eigenvalues>
#include <nlohmann/json.hpp>

#include "document/document.hpp"

namespace quasilpv {
namespace {

constexpr double kSymmetryTolerance = 1e-12;      // relative to the largest entry
constexpr double kDefinitenessTolerance = 1e-12;  // smallest over largest eigenvalue

void require_symmetric(const Field& field, const std::string& name, const Eigen::MatrixXd& matrix,
                       const std::string& expected) {
  const double asymmetry = (matrix - matrix.transpose()).cwiseAbs().maxCoeff();
  if (!(asymmetry <= kSymmetryTolerance * matrix.cwiseAbs().maxCoeff())) {
    field.fail(name + " with asymmetry " + Json(asymmetry).dump(), expected);
  }
}

void require_positive_definite(const Field& field, const std::string& where, const Eigen::MatrixXd& matrix,
                               const std::string& expected) {
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
  const double smallest = eigenvalues.minCoeff();
  if (!(smallest > kDefinitenessTolerance * eigenvalues.cwiseAbs().maxCoeff())) {
    field.fail("smallest eigenvalue " + Json(smallest).dump() + where, expected);
  }
}

}  // namespace

// Only the centre is tested for definiteness: premises depend on each other, so a corner of the box need not be a
// configuration of the robot, and the design inertia may rightly be indefinite there.
BlockPolytope read_inertia(const Field& field, int joints) {
  BlockPolytope inertia = BlockPolytope::parse(field, joints, joints);
  for (int i = 0; i < inertia.vertices(); ++i) {
    require_symmetric(field["blocks"], "vertex " + std::to_string(i), inertia.vertex(i), "symmetric vertices");
  }
  require_positive_definite(field, " at the centre of the box", inertia.at_centre(), "a positive definite inertia");
  return inertia;
}

std::shared_ptr<const TreeDynamics> read_design_tree(const Field& field, int joints, const Field* load) {
  KinematicTree tree = read_bare_tree(field);
  if (tree.joints.size() != static_cast<std::size_t>(joints)) {
    field["joints"].fail(std::to_string(tree.joints.size()) + " joints", std::to_string(joints));
  }
  if (load != nullptr) {
    tree.gravity_load = read_gravity_load(*load);
  }
  return std::make_shared<const TreeDynamics>(tree);
}

std::array<Interval, kMaxJoints> read_intervals(const Field& field, int joints) {
  if (field.size() != static_cast<std::size_t>(joints)) {
    field.fail("an array of " + std::to_string(field.size()), std::to_string(joints) + " intervals, one per joint");
  }
  std::array<Interval, kMaxJoints> result{};
  for (std::size_t j = 0; j < field.size(); ++j) {
    const std::vector<double> bounds = field.at(j).numbers(2);
    if (bounds[0] >= bounds[1]) {
      field.at(j).fail("[" + canonical_number(bounds[0]) + ", " + canonical_number(bounds[1]) + "]",
                       "a lower bound below the upper bound");
    }
    result[j] = {bounds[0], bounds[1]};
  }
  return result;
}

Eigen::MatrixXd read_lyapunov(const Field& field, int size) {
  Eigen::MatrixXd lyapunov = parse_matrix(field, size, size);
  require_symmetric(field, "a matrix", lyapunov, "a symmetric matrix");
  require_positive_definite(field, "", lyapunov, "a positive definite matrix");
  return lyapunov;
}

BlockPolytope read_lyapunov_polytope(const Field& field, int size) {
  BlockPolytope lyapunov = BlockPolytope::parse(field, size, size);
  for (int k = 0; k < lyapunov.vertices(); ++k) {
    const std::string vertex = "vertex " + std::to_string(k);
    require_symmetric(field["blocks"], vertex, lyapunov.vertex(k), "symmetric vertices");
    require_positive_definite(field["blocks"], " of " + vertex, lyapunov.vertex(k), "positive definite vertices");
  }
  return lyapunov;
}

}  // namespace quasilpv
