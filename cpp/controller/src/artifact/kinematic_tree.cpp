#include "quasilpv/kinematic_tree.hpp"

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>

#include "artifact/tree_sweep.hpp"
#include "document/field.hpp"

namespace quasilpv {
namespace {

// Descriptions print angles with few digits, but their readers make rotations of them in double precision.
constexpr double kRotationTolerance = 1e-9;

Eigen::Vector3d read_vector(const Field& field) {
  const std::vector<double> values = field.numbers(3);
  return {values[0], values[1], values[2]};
}

Eigen::Matrix3d read_rows(const Field& field) {
  if (field.size() != 3) {
    field.fail(std::to_string(field.size()) + " rows", "3");
  }
  Eigen::Matrix3d rows;
  for (std::size_t i = 0; i < 3; ++i) {
    rows.row(static_cast<Eigen::Index>(i)) = read_vector(field.at(i));
  }
  return rows;
}

Eigen::Matrix3d read_rotation(const Field& field) {
  const Eigen::Matrix3d R = read_rows(field);
  if (!((R * R.transpose()).isApprox(Eigen::Matrix3d::Identity(), kRotationTolerance)) || R.determinant() < 0.0) {
    field.fail("a matrix that is none", "a rotation");
  }
  return R;
}

// A body has no negative kinetic energy; a rounding of the last digits is no body's fault.
void check_body(const Field& field, const TreeJoint& joint) {
  if (joint.rotational_kg_m2 != joint.rotational_kg_m2.transpose()) {
    field["rotational_kg_m2"].fail("a matrix that is not symmetric", "a symmetric matrix");
  }
  Eigen::Matrix<double, 6, 6> body = Eigen::Matrix<double, 6, 6>::Zero();
  const Eigen::Vector3d& h = joint.first_moment_kg_m;
  Eigen::Matrix3d H;
  H << 0.0, -h.z(), h.y(), h.z(), 0.0, -h.x(), -h.y(), h.x(), 0.0;
  body.topLeftCorner<3, 3>().diagonal().setConstant(joint.mass_kg);
  body.topRightCorner<3, 3>() = -H;
  body.bottomLeftCorner<3, 3>() = H;
  body.bottomRightCorner<3, 3>() = joint.rotational_kg_m2;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(body, Eigen::EigenvaluesOnly);
  if (solver.eigenvalues()[0] < -1e-12 * std::abs(solver.eigenvalues()[5])) {
    field["rotational_kg_m2"].fail("a body of negative kinetic energy", "the ten parameters of a rigid body");
  }
}

TreeJoint read_joint(const Field& field) {
  TreeJoint joint;
  joint.name = field["name"].text();
  const std::string kind = field["kind"].text();
  if (kind != "revolute" && kind != "continuous" && kind != "prismatic") {
    field["kind"].fail("\"" + kind + "\"", "\"revolute\", \"continuous\" or \"prismatic\"");
  }
  joint.turns = kind != "prismatic";
  joint.rotation = read_rotation(field["rotation"]);
  joint.translation_m = read_vector(field["translation_m"]);
  joint.axis = read_vector(field["axis"]);
  if (std::abs(joint.axis.norm() - 1.0) > kRotationTolerance) {
    field["axis"].fail("a vector of another length", "a unit vector");
  }
  joint.mass_kg = field["mass_kg"].non_negative();
  joint.first_moment_kg_m = read_vector(field["first_moment_kg_m"]);
  joint.rotational_kg_m2 = read_rows(field["rotational_kg_m2"]);
  joint.rotor_inertia_kg_m2 = field["rotor_inertia_kg_m2"].non_negative();
  check_body(field, joint);
  return joint;
}

}  // namespace

KinematicTree read_tree(const Field& field) {
  KinematicTree tree;
  tree.gravity_m_s2 = read_vector(field["gravity_m_s2"]);
  const Field joints = field["joints"];
  if (joints.size() < 1 || joints.size() > static_cast<std::size_t>(kMaxJoints)) {
    joints.fail(std::to_string(joints.size()) + " joints", "1 to " + std::to_string(kMaxJoints));
  }
  for (std::size_t k = 0; k < joints.size(); ++k) {
    tree.joints.push_back(read_joint(joints.at(k)));
  }
  return tree;
}

KinematicTree read_bare_tree(const Field& field) {
  field.only({"kind", "gravity_m_s2", "joints"});
  field["kind"].expect_text("tree");
  const Field joints = field["joints"];
  for (std::size_t k = 0; k < joints.size(); ++k) {
    joints.at(k).only({"name", "kind", "rotation", "translation_m", "axis", "mass_kg", "first_moment_kg_m",
                       "rotational_kg_m2", "rotor_inertia_kg_m2"});
  }
  return read_tree(field);
}

GravityLoad read_gravity_load(const Field& field) {
  field.only({"mass_kg", "first_moment_kg_m"});
  return {field["mass_kg"].non_negative(), read_vector(field["first_moment_kg_m"])};
}

TreeDynamics::TreeDynamics(const KinematicTree& tree)
    : joint_{}, gravity_(tree.gravity_m_s2), load_(tree.gravity_load), joints_(static_cast<int>(tree.joints.size())) {
  for (std::size_t k = 0; k < tree.joints.size(); ++k) {
    const TreeJoint& joint = tree.joints[k];
    joint_[k] = {joint.turns,   joint.rotation.transpose(), joint.translation_m,    joint.axis,
                 joint.mass_kg, joint.first_moment_kg_m,    joint.rotational_kg_m2, joint.rotor_inertia_kg_m2};
  }
}

void TreeDynamics::torque_at_rest(const double* q, const double* acceleration, double* torque) const noexcept {
  TreeSweep::inverse_dynamics<double>(*this, q, nullptr, acceleration, torque);
}

void TreeDynamics::inverse_dynamics(const double* q, const double* speed, const double* acceleration,
                                    double* torque) const noexcept {
  TreeSweep::inverse_dynamics<double>(*this, q, speed, acceleration, torque);
}

// Composite bodies (Featherstone 2008, section 6.2): the inertia of everything behind a joint, seen from its frame.
TreeMatrix TreeDynamics::inertia(const double* q) const noexcept {
  const int n = joints_;
  TreeMatrix M = TreeMatrix::Zero(n, n);
  std::array<Pose<double>, kMaxJoints> poses;
  std::array<Joint, kMaxJoints> carried = joint_;
  for (int k = 0; k < n; ++k) {
    poses[static_cast<std::size_t>(k)] = TreeSweep::pose<double>(joint_[static_cast<std::size_t>(k)], q[k]);
  }
  for (int k = n - 1; k >= 0; --k) {
    const auto place = static_cast<std::size_t>(k);
    const Joint& body = carried[place];
    const Eigen::Vector3d none = Eigen::Vector3d::Zero();
    const Spatial<double> twist = body.turns ? Spatial<double>{none, body.axis} : Spatial<double>{body.axis, none};
    Spatial<double> wrench = TreeSweep::momentum<double>(body, twist);
    M(k, k) = body.axis.dot(body.turns ? wrench.angular : wrench.linear) + body.rotor;
    for (int i = k; i > 0; --i) {
      wrench = poses[static_cast<std::size_t>(i)].return_wrench(wrench);
      const Joint& before = joint_[static_cast<std::size_t>(i - 1)];
      M(k, i - 1) = M(i - 1, k) = before.axis.dot(before.turns ? wrench.angular : wrench.linear);
    }
    if (k > 0) {
      // The body about the frame before: rotate its ten parameters, then move the origin by p. With h turned,
      // I <- R I R' + m (p.p 1 - p p') + 2 p.h 1 - p h' - h p'.
      const Pose<double>& pose = poses[place];
      const Eigen::Vector3d h = pose.E.transpose() * body.first_moment;
      const Eigen::Vector3d& p = pose.place;
      Joint& sum = carried[place - 1];
      sum.mass += body.mass;
      sum.first_moment += h + body.mass * p;
      sum.rotational += pose.E.transpose() * body.rotational * pose.E - body.mass * p * p.transpose() -
                        p * h.transpose() - h * p.transpose();
      sum.rotational.diagonal().array() += body.mass * p.squaredNorm() + 2.0 * p.dot(h);
    }
  }
  return M;
}

double TreeDynamics::energy(const double* q, const double* speed) const noexcept {
  const Eigen::Map<const TreeVector> w(speed, joints_);
  double energy = 0.5 * w.dot(inertia(q) * w);
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (int k = 0; k < joints_; ++k) {
    const Joint& joint = joint_[static_cast<std::size_t>(k)];
    const Pose<double> pose = TreeSweep::pose<double>(joint, q[k]);
    origin += R * pose.place;
    R = R * pose.E.transpose();
    energy -= gravity_.dot(joint.mass * origin + R * joint.first_moment);
  }
  return energy;
}

}  // namespace quasilpv
