// The recursion over a chain of bodies against closed forms, identities of mechanics, and what is refused.
#include "quasilpv/kinematic_tree.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <random>
#include <string>
#include <vector>

#include "artifact_fixture.hpp"
#include "decompositions.hpp"
#include "document/field.hpp"
#include "quasilpv/tree_plant.hpp"

namespace quasilpv::testing {
namespace {

constexpr double kGravity = 9.81;
const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();

/// A body about its joint's frame from its moment of inertia about its centre of mass.
TreeJoint joint_with_body(const Eigen::Vector3d& axis, double mass, const Eigen::Vector3d& com,
                          const Eigen::Matrix3d& about_com) {
  TreeJoint joint;
  joint.rotation.setIdentity();
  joint.translation_m.setZero();
  joint.axis = axis.normalized();
  joint.mass_kg = mass;
  joint.first_moment_kg_m = mass * com;
  joint.rotational_kg_m2 = about_com + mass * (com.squaredNorm() * Eigen::Matrix3d::Identity() - com * com.transpose());
  return joint;
}

KinematicTree tree_of(std::vector<TreeJoint> joints) { return {std::move(joints), -kGravity * kUp, {}}; }

/// Any chain: random placements, oblique axes, true bodies, some joints that slide.
KinematicTree random_tree(int joints, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d(uniform(random), uniform(random), uniform(random)); };
  std::vector<TreeJoint> chain;
  for (int k = 0; k < joints; ++k) {
    const Eigen::Matrix3d root = Eigen::Matrix3d::NullaryExpr([&] { return 0.3 * uniform(random); });
    TreeJoint joint = joint_with_body(vector(), 1.5 + uniform(random), 0.3 * vector(), root * root.transpose());
    joint.turns = uniform(random) > -0.6;
    joint.rotation = Eigen::AngleAxisd(3.0 * uniform(random), vector().normalized()).toRotationMatrix();
    joint.translation_m = 0.4 * vector();
    joint.rotor_inertia_kg_m2 = 0.1 + 0.1 * uniform(random);
    chain.push_back(joint);
  }
  return tree_of(chain);
}

TreeVector random_vector(int size, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  return TreeVector::NullaryExpr(size, [&] { return uniform(random); });
}

TEST(KinematicTree, of_one_revolute_joint_is_the_physical_pendulum) {
  const double m = 1.7;
  const double r = 0.4;
  const double inertia = 0.05;
  TreeJoint joint = joint_with_body(Eigen::Vector3d::UnitY(), m, {0.0, 0.0, -r}, inertia * Eigen::Matrix3d::Identity());
  joint.rotor_inertia_kg_m2 = 0.02;
  const TreeDynamics pendulum(tree_of({joint}));
  for (const double q : {-3.0, -0.4, 0.0, 1.1, 2.5}) {
    const double w = 1.3;
    const double a = -0.7;
    double torque = 0.0;
    pendulum.inverse_dynamics(&q, &w, &a, &torque);
    const double total = inertia + m * r * r + 0.02;
    EXPECT_NEAR(torque, total * a + m * kGravity * r * std::sin(q), 1e-13);
    EXPECT_NEAR(pendulum.inertia(&q)(0, 0), total, 1e-14);
    EXPECT_NEAR(pendulum.energy(&q, &w), total * w * w / 2.0 - m * kGravity * r * std::cos(q), 1e-13);
  }
}

// Relative angles from hanging (Spong, Hutchinson, Vidyasagar 2006, section 7.3).
TEST(KinematicTree, of_two_parallel_axes_is_the_two_link_arm_in_closed_form) {
  const double m1 = 2.0;
  const double m2 = 1.2;
  const double l1 = 0.5;
  const double c1 = 0.2;
  const double c2 = 0.3;
  const double I1 = 0.07;
  const double I2 = 0.04;
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  std::vector<TreeJoint> joints{joint_with_body(Eigen::Vector3d::UnitY(), m1, {0.0, 0.0, -c1}, I1 * one),
                                joint_with_body(Eigen::Vector3d::UnitY(), m2, {0.0, 0.0, -c2}, I2 * one)};
  joints[1].translation_m = {0.0, 0.0, -l1};
  const TreeDynamics arm(tree_of(joints));
  std::mt19937 random(1);
  for (int sample = 0; sample < 50; ++sample) {
    const TreeVector q = 3.0 * random_vector(2, random);
    const TreeVector w = 4.0 * random_vector(2, random);
    const TreeVector a = 9.0 * random_vector(2, random);
    const double cosine = std::cos(q[1]);
    const double h = m2 * l1 * c2 * std::sin(q[1]);
    Eigen::Matrix2d M;
    M(1, 1) = I2 + m2 * c2 * c2;
    M(0, 1) = M(1, 0) = M(1, 1) + m2 * l1 * c2 * cosine;
    M(0, 0) = I1 + m1 * c1 * c1 + M(1, 1) + m2 * (l1 * l1 + 2.0 * l1 * c2 * cosine);
    const double g2 = m2 * kGravity * c2 * std::sin(q[0] + q[1]);
    const Eigen::Vector2d gravity((m1 * c1 + m2 * l1) * kGravity * std::sin(q[0]) + g2, g2);
    const Eigen::Vector2d coriolis(-h * (2.0 * w[0] * w[1] + w[1] * w[1]), h * w[0] * w[0]);
    TreeVector torque(2);
    arm.inverse_dynamics(q.data(), w.data(), a.data(), torque.data());
    EXPECT_LT((torque - (M * a + coriolis + gravity)).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((arm.inertia(q.data()) - M).cwiseAbs().maxCoeff(), 1e-14);
    arm.torque_at_rest(q.data(), a.data(), torque.data());
    EXPECT_LT((torque - (M * a + gravity)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(KinematicTree, with_a_sliding_joint_on_a_turning_one_is_a_bead_on_a_rod) {
  const double m = 0.8;
  TreeJoint rod = joint_with_body(kUp, 0.0, Eigen::Vector3d::Zero(), 0.3 * Eigen::Matrix3d::Identity());
  TreeJoint bead = joint_with_body(Eigen::Vector3d::UnitX(), m, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero());
  bead.turns = false;
  const TreeDynamics dynamics(tree_of({rod, bead}));
  const std::array<double, 2> q{0.7, 0.45};
  const std::array<double, 2> w{2.0, -1.5};
  const std::array<double, 2> a{0.9, 3.0};
  std::array<double, 2> torque{};
  dynamics.inverse_dynamics(q.data(), w.data(), a.data(), torque.data());
  EXPECT_NEAR(torque[0], (0.3 + m * q[1] * q[1]) * a[0] + 2.0 * m * q[1] * w[0] * w[1], 1e-14);
  EXPECT_NEAR(torque[1], m * (a[1] - q[1] * w[0] * w[0]), 1e-14);
}

TEST(KinematicTree, that_slides_upwards_is_lifted_against_its_weight) {
  TreeJoint lift = joint_with_body(kUp, 2.5, {0.3, -0.2, 0.1}, 0.1 * Eigen::Matrix3d::Identity());
  lift.turns = false;
  lift.rotor_inertia_kg_m2 = 1.5;
  const TreeDynamics dynamics(tree_of({lift}));
  const double q = 0.2;
  const double w = 5.0;
  const double a = 1.1;
  double force = 0.0;
  dynamics.inverse_dynamics(&q, &w, &a, &force);
  EXPECT_NEAR(force, 4.0 * a + 2.5 * kGravity, 1e-13);
}

// A joint whose axis is oblique in its own frame is the same joint in a frame turned such that the axis is z.
TEST(KinematicTree, does_not_depend_on_the_frames_in_which_oblique_axes_are_written) {
  std::mt19937 random(2);
  for (int sample = 0; sample < 20; ++sample) {
    const KinematicTree oblique = random_tree(5, random);
    KinematicTree straight = oblique;
    for (std::size_t k = 0; k < straight.joints.size(); ++k) {
      const Eigen::Matrix3d R = rotation_between(kUp, oblique.joints[k].axis);  // its axes in the old ones
      TreeJoint& joint = straight.joints[k];
      joint.axis = R.transpose() * joint.axis;
      joint.rotation = joint.rotation * R;
      joint.first_moment_kg_m = R.transpose() * joint.first_moment_kg_m;
      joint.rotational_kg_m2 = R.transpose() * joint.rotational_kg_m2 * R;
      if (k + 1 < straight.joints.size()) {
        TreeJoint& next = straight.joints[k + 1];
        next.rotation = R.transpose() * next.rotation;
        next.translation_m = R.transpose() * next.translation_m;
      }
    }
    const TreeVector q = 2.0 * random_vector(5, random);
    const TreeVector w = 3.0 * random_vector(5, random);
    const TreeVector a = 5.0 * random_vector(5, random);
    TreeVector first(5);
    TreeVector second(5);
    TreeDynamics(oblique).inverse_dynamics(q.data(), w.data(), a.data(), first.data());
    TreeDynamics(straight).inverse_dynamics(q.data(), w.data(), a.data(), second.data());
    EXPECT_LT((first - second).cwiseAbs().maxCoeff(), 1e-11 * (1.0 + first.cwiseAbs().maxCoeff()));
  }
}

TEST(KinematicTree, has_a_symmetric_positive_definite_inertia_whose_columns_are_unit_accelerations) {
  std::mt19937 random(3);
  for (int n = 1; n <= kMaxJoints; ++n) {
    KinematicTree tree = random_tree(n, random);
    tree.gravity_m_s2.setZero();
    const TreeDynamics dynamics(tree);
    for (int sample = 0; sample < 20; ++sample) {
      const TreeVector q = 3.0 * random_vector(n, random);
      const TreeMatrix M = dynamics.inertia(q.data());
      EXPECT_EQ(M, M.transpose());
      EXPECT_GT(least_eigenvalue(M), 0.0);
      for (int k = 0; k < n; ++k) {
        const TreeVector unit = TreeVector::Unit(n, k);
        TreeVector column(n);
        dynamics.torque_at_rest(q.data(), unit.data(), column.data());
        EXPECT_LT((M.col(k) - column).cwiseAbs().maxCoeff(), 1e-13 * (1.0 + M.cwiseAbs().maxCoeff()));
      }
    }
  }
}

// w' (dM/dt - 2 C) w = 0: the power of the torques is the growth of the energy, along any motion.
TEST(KinematicTree, gains_the_energy_that_its_torques_put_in) {
  std::mt19937 random(4);
  for (int n = 1; n <= kMaxJoints; ++n) {
    const TreeDynamics dynamics(random_tree(n, random));
    const TreeVector q = 3.0 * random_vector(n, random);
    const TreeVector w = random_vector(n, random);
    const TreeVector a = random_vector(n, random);
    TreeVector torque(n);
    dynamics.inverse_dynamics(q.data(), w.data(), a.data(), torque.data());
    const auto energy = [&](double t) {
      const TreeVector at = q + t * w + t * t / 2.0 * a;
      const TreeVector speed = w + t * a;
      return dynamics.energy(at.data(), speed.data());
    };
    const double h = 1e-4;
    const double slope = (8.0 * (energy(h) - energy(-h)) - (energy(2.0 * h) - energy(-2.0 * h))) / (12.0 * h);
    EXPECT_NEAR(slope, w.dot(torque), 1e-8 * (1.0 + std::abs(slope) + std::abs(energy(0.0))));
  }
}

TEST(KinematicTree, keeps_its_energy_as_a_plant_that_nothing_drives) {
  std::mt19937 random(5);
  const KinematicTree tree = random_tree(4, random);
  TreePlant plant({"free", tree, std::vector<JointFriction>(4)});
  const JointArray start{0.3, -0.5, 0.2, 0.7};
  const JointArray speed{0.4, 0.1, -0.3, 0.2};
  Eigen::VectorXd y = plant.initial_state(start, speed);
  const double before = plant.dynamics().energy(y.data(), y.data() + 4);
  const double h = 2e-4;
  Eigen::VectorXd k1(8);
  Eigen::VectorXd k2(8);
  Eigen::VectorXd k3(8);
  Eigen::VectorXd k4(8);
  double potential_moved = 0.0;
  const TreeVector rest = TreeVector::Zero(4);
  const double potential = plant.dynamics().energy(y.data(), rest.data());
  for (int step = 0; step < 5000; ++step) {
    plant.derivative(0.0, y, k1);
    plant.derivative(0.0, y + h / 2.0 * k1, k2);
    plant.derivative(0.0, y + h / 2.0 * k2, k3);
    plant.derivative(0.0, y + h * k3, k4);
    y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    potential_moved = std::max(potential_moved, std::abs(plant.dynamics().energy(y.data(), rest.data()) - potential));
  }
  EXPECT_GT(potential_moved, 1.0);  // it fell: energy went from one form to the other
  EXPECT_NEAR(plant.dynamics().energy(y.data(), y.data() + 4), before, 1e-6 * potential_moved);
}

TEST(KinematicTree, carries_a_load_for_its_gravity_only) {
  std::mt19937 random(6);
  KinematicTree tree = random_tree(6, random);
  const TreeDynamics empty(tree);
  tree.gravity_load = {1.3, {0.1, -0.2, 0.3}};
  const TreeDynamics loaded(tree);
  KinematicTree heavy = tree;
  heavy.gravity_load = {};
  heavy.joints.back().mass_kg += tree.gravity_load.mass_kg;
  heavy.joints.back().first_moment_kg_m += tree.gravity_load.first_moment_kg_m;
  const TreeDynamics body(heavy);
  const TreeVector q = 3.0 * random_vector(6, random);
  const TreeVector a = 3.0 * random_vector(6, random);
  const TreeVector rest = TreeVector::Zero(6);
  TreeVector torque(6);
  TreeVector without(6);
  TreeVector weight(6);
  TreeVector own_weight(6);
  loaded.torque_at_rest(q.data(), a.data(), torque.data());
  empty.torque_at_rest(q.data(), a.data(), without.data());
  body.torque_at_rest(q.data(), rest.data(), weight.data());
  empty.torque_at_rest(q.data(), rest.data(), own_weight.data());
  EXPECT_LT(((torque - without) - (weight - own_weight)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(loaded.inertia(q.data()), empty.inertia(q.data()));
}

TEST(KinematicTree, is_read_strictly) {
  const Json table = with_chain(artifact_table("dob-acceleration", 3))["law"]["inertia"];
  const auto refused = [&](std::size_t joint, const char* member, const Json& value) {
    Json changed = table;
    changed["joints"][joint][member] = value;
    return refusal([&] { read_bare_tree(Field(changed, "test", "")); });
  };
  EXPECT_NO_THROW(read_bare_tree(Field(table, "test", "")));
  const auto names = [](const std::string& message, const std::string& place) {
    return message.find(place) != std::string::npos;
  };
  EXPECT_TRUE(names(refused(1, "kind", "screw"), "joints[1].kind"));
  EXPECT_TRUE(names(refused(1, "axis", {0.0, 0.0, 2.0}), "joints[1].axis"));
  EXPECT_TRUE(names(refused(0, "axis", {0.0, 1.0}), "joints[0].axis"));
  const Json mirror = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, -1.0}};
  EXPECT_TRUE(names(refused(2, "rotation", mirror), "joints[2].rotation"));
  EXPECT_TRUE(names(refused(2, "mass_kg", -1.0), "joints[2].mass_kg"));
  const Json lopsided = {{0.2, 0.1, 0.0}, {0.0, 0.2, 0.0}, {0.0, 0.0, 0.1}};
  EXPECT_TRUE(names(refused(2, "rotational_kg_m2", lopsided), "joints[2].rotational_kg_m2"));
  EXPECT_TRUE(names(refused(2, "first_moment_kg_m", {0.0, 0.0, 3.0}), "joints[2].rotational_kg_m2"));
  EXPECT_TRUE(names(refused(0, "colour", "red"), "colour"));
}

}  // namespace
}  // namespace quasilpv::testing
