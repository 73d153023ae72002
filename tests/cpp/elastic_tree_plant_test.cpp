// The robot with elastic joints: its iteration matrix, its energy, and what a brake pushes.
#include "quasilpv/elastic_tree_plant.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "artifact_fixture.hpp"
#include "document/field.hpp"
#include "quasilpv/tree_plant.hpp"

namespace quasilpv::testing {
namespace {

constexpr int kJoints = 4;

ElasticTreeParameters elastic_arm(double damping, double friction) {
  ElasticTreeParameters parameters;
  parameters.label = "elastic";
  const Json table = with_chain(artifact_table("dob-acceleration", kJoints))["law"]["inertia"];
  parameters.tree = read_bare_tree(Field(table, "test", ""));
  for (std::size_t k = 0; k < kJoints; ++k) {
    parameters.tree.joints[k].rotor_inertia_kg_m2 = 0.0;
    parameters.gears.push_back({4e3 + 1e3 * static_cast<double>(k), damping, 0.2 + 0.05 * static_cast<double>(k)});
    parameters.friction.push_back({friction, 2.0 * friction, 0.05});
  }
  return parameters;
}

/// Joints that stick in an arm whose drives control torques.
ElasticTreeParameters sticking_arm(double lag_s) {
  ElasticTreeParameters parameters = elastic_arm(2.0, 1.5);
  for (std::size_t k : {0, 2}) {
    JointFriction& friction = parameters.friction[k];
    friction.breakaway_nm = 1.5 * friction.coulomb_nm;
    friction.stribeck_speed_rad_s = 0.5;
    friction.presliding_rad = 0.05;
    friction.presliding_damping_nm_s = 3.0;
  }
  parameters.torque_loop = {4.0, lag_s};
  return parameters;
}

void expect_iteration_matrix(const ElasticTreeParameters& parameters) {
  ElasticTreePlant plant(parameters);
  plant.set_external_torque(ExternalTorque({{1, 20.0, 15.0, 0.3}}));
  const double c_j = 250.0;
  const double step = 1e-6;
  std::srand(1);
  for (int sample = 0; sample < 10; ++sample) {
    const Eigen::VectorXd y = Eigen::VectorXd::Random(plant.size());
    const Eigen::VectorXd y_dot = 5.0 * Eigen::VectorXd::Random(plant.size());
    Eigen::MatrixXd jacobian(plant.size(), plant.size());
    plant.jacobian(0.1, c_j, y, y_dot, jacobian);
    Eigen::VectorXd ahead(plant.size());
    Eigen::VectorXd behind(plant.size());
    for (int i = 0; i < plant.size(); ++i) {
      const Eigen::VectorXd unit = step * Eigen::VectorXd::Unit(plant.size(), i);
      plant.residual(0.1, y + unit, y_dot + c_j * unit, ahead);
      plant.residual(0.1, y - unit, y_dot - c_j * unit, behind);
      const Eigen::VectorXd slope = (ahead - behind) / (2.0 * step);
      EXPECT_LT((jacobian.col(i) - slope).cwiseAbs().maxCoeff(), 2e-5 * (1.0 + slope.cwiseAbs().maxCoeff())) << i;
    }
  }
}

TEST(ElasticTreePlant, has_the_iteration_matrix_of_its_residual) {
  expect_iteration_matrix(elastic_arm(2.0, 1.5));
  expect_iteration_matrix(sticking_arm(0.0));
  expect_iteration_matrix(sticking_arm(2e-3));
}

TEST(ElasticTreePlant, has_the_derivative_that_makes_its_residual_zero) {
  for (const ElasticTreeParameters& parameters : {elastic_arm(2.0, 1.5), sticking_arm(0.0), sticking_arm(2e-3)}) {
    ElasticTreePlant plant(parameters);
    plant.set_torque({3.0, -20.0, 5.0, 1.0});
    const Eigen::VectorXd y = Eigen::VectorXd::LinSpaced(plant.size(), -0.9, 0.8);
    Eigen::VectorXd y_dot(plant.size());
    plant.derivative(0.0, y, y_dot);
    Eigen::VectorXd residual(plant.size());
    plant.residual(0.0, y, y_dot, residual);
    EXPECT_LT(residual.cwiseAbs().maxCoeff(), 1e-9 * (1.0 + y_dot.cwiseAbs().maxCoeff()));
  }
}

// Of drives that lag, whose torque moves nothing at once, as of drives that do not; there it is what sample() shows.
TEST(ElasticTreePlant, a_brake_finds_drives_that_lag_as_mobile_as_others) {
  for (const double lag_s : {0.0, 2e-3}) {
    ElasticTreePlant elastic(sticking_arm(lag_s));
    ElasticTreePlant prompt(sticking_arm(0.0));
    TreePlantParameters parameters{"rigid", elastic.parameters().tree, std::vector<JointFriction>(kJoints), lag_s};
    TreePlant rigid(parameters);
    parameters.lag_s = 0.0;
    TreePlant prompt_rigid(parameters);
    const JointArray angle{0.3, -0.5, 0.4, 0.2};
    const JointArray motors = prompt.Plant::mobility(0.0, prompt.initial_state(angle, {}));
    const JointArray joints = prompt_rigid.Plant::mobility(0.0, prompt_rigid.initial_state(angle, {}));
    const JointArray found = elastic.mobility(0.0, elastic.initial_state(angle, {}));
    const JointArray found_rigid = rigid.mobility(0.0, rigid.initial_state(angle, {}));
    for (std::size_t j = 0; j < kJoints; ++j) {
      EXPECT_NEAR(found[j], motors[j], 1e-8 * motors[j]);
      EXPECT_NEAR(found_rigid[j], joints[j], 1e-8 * joints[j]);
      EXPECT_GT(joints[j], 0.0);
    }
  }
}

// s (command - spring) + spring instead of the command: a rotor of B / s under the command itself.
TEST(ElasticTreePlant, a_torque_loop_makes_the_rotor_smaller) {
  ElasticTreeParameters looped = elastic_arm(2.0, 0.0);
  ElasticTreeParameters smaller = looped;
  looped.torque_loop = {4.0, 0.0};
  for (ElasticGear& gear : smaller.gears) {
    gear.rotor_inertia_kg_m2 /= 4.0;
  }
  ElasticTreePlant one(looped);
  ElasticTreePlant other(smaller);
  const Eigen::VectorXd y = Eigen::VectorXd::LinSpaced(one.size(), -0.02, 0.03);
  Eigen::VectorXd first(one.size());
  Eigen::VectorXd second(one.size());
  for (ElasticTreePlant* plant : {&one, &other}) {
    plant->set_torque({3.0, -20.0, 5.0, 1.0});
    plant->derivative(0.0, y, plant == &one ? first : second);
  }
  EXPECT_LT((first - second).cwiseAbs().maxCoeff(), 1e-9 * (1.0 + second.cwiseAbs().maxCoeff()));
}

TEST(ElasticTreePlant, when_its_drives_lag_expect_them_to_begin_with_what_holds_the_robot) {
  ElasticTreePlant plant(sticking_arm(2e-3));
  const JointArray angle{0.3, -0.5, 0.4, 0.2};
  const Eigen::VectorXd y = plant.initial_state(angle, {});
  EXPECT_EQ(y.size(), 6 * kJoints);
  JointArray weight{};
  std::copy_n(y.data() + 4 * kJoints, kJoints, weight.begin());
  plant.set_torque(weight);
  Eigen::VectorXd y_dot(plant.size());
  plant.derivative(0.0, y, y_dot);
  EXPECT_LT(y_dot.cwiseAbs().maxCoeff(), 1e-8);
}

// Without damping and friction nothing takes energy out; with them it only falls.
TEST(ElasticTreePlant, keeps_its_energy_without_damping_and_loses_it_with) {
  for (const double damping : {0.0, 3.0}) {
    const ElasticTreePlant plant(elastic_arm(damping, 0.0));
    Eigen::VectorXd y = plant.initial_state({0.3, -0.5, 0.4, 0.2}, {});
    y.segment(kJoints, kJoints).array() += 0.01;  // springs that are let go
    const double before = plant.energy(y);
    const double h = 1e-4;
    Eigen::VectorXd k1(plant.size());
    Eigen::VectorXd k2(plant.size());
    Eigen::VectorXd k3(plant.size());
    Eigen::VectorXd k4(plant.size());
    double moved = 0.0;
    const Eigen::VectorXd start = y;
    for (int step = 0; step < 4000; ++step) {
      plant.derivative(0.0, y, k1);
      plant.derivative(0.0, y + h / 2.0 * k1, k2);
      plant.derivative(0.0, y + h / 2.0 * k2, k3);
      plant.derivative(0.0, y + h * k3, k4);
      y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
      moved = std::max(moved, (y - start).head(kJoints).cwiseAbs().maxCoeff());
    }
    EXPECT_GT(moved, 0.1);
    if (damping == 0.0) {
      EXPECT_NEAR(plant.energy(y), before, 1e-5 * std::abs(before));
    } else {
      EXPECT_LT(plant.energy(y), before - 0.01);
    }
  }
}

// With undamped gears friction alone takes energy out, step by step, its bristles included.
TEST(ElasticTreePlant, never_gains_energy_from_joints_that_stick) {
  ElasticTreeParameters parameters = sticking_arm(0.0);
  parameters.torque_loop = {};
  for (std::size_t k = 0; k < kJoints; ++k) {
    parameters.gears[k].damping_nm_s = 0.0;
    parameters.friction[k] = {0.0, 1.0, 1.0, 1.8, 0.05, 2e-3, 10.0};
  }
  const ElasticTreePlant plant(parameters);
  Eigen::VectorXd y = plant.initial_state({0.3, -0.5, 0.4, 0.2}, {});
  y.segment(kJoints, kJoints).array() += 0.003;
  const double start = plant.energy(y);
  double before = start;
  const double h = 5e-5;
  Eigen::VectorXd k1(plant.size()), k2(plant.size()), k3(plant.size()), k4(plant.size());
  for (int step = 0; step < 6000; ++step) {
    plant.derivative(0.0, y, k1);
    plant.derivative(0.0, y + h / 2.0 * k1, k2);
    plant.derivative(0.0, y + h / 2.0 * k2, k3);
    plant.derivative(0.0, y + h * k3, k4);
    y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    const double now = plant.energy(y);
    ASSERT_LE(now, before + 1e-7) << step;
    before = now;
  }
  EXPECT_LT(before, start - 0.01);
}

TEST(ElasticTreePlant, shows_encoders_on_the_side_they_sit_on_and_the_motors_to_the_brake) {
  for (const bool on_motors : {true, false}) {
    ElasticTreeParameters parameters = elastic_arm(1.0, 0.0);
    parameters.sensors = on_motors ? kMotorAngle | kLinkAngle | kJointTorque : kLinkAngle;
    ElasticTreePlant plant(parameters);
    Eigen::VectorXd y = plant.initial_state({0.1, 0.2, 0.3, 0.4}, {});
    y.tail(kJoints).setConstant(0.7);
    plant.set_torque({1.0, 0.0, 0.0, 0.0});
    const PlantSample pushed = plant.sample(0.0, y);
    plant.set_torque({});
    const PlantSample free = plant.sample(0.0, y);
    EXPECT_EQ(pushed.angle[1], 0.2);
    EXPECT_EQ(pushed.encoder_angle()[1], on_motors ? y[kJoints + 1] : 0.2);
    EXPECT_EQ(pushed.encoder_speed()[1], on_motors ? 0.7 : 0.0);
    EXPECT_EQ(pushed.driven_speed()[1], 0.7);
    ASSERT_TRUE(pushed.motors.has_value());
    EXPECT_EQ(pushed.motors->sensors, parameters.sensors);
    const ElasticGear& gear = parameters.gears[1];
    EXPECT_NEAR(pushed.motors->joint_torque[1],
                gear.stiffness_nm_rad * (y[kJoints + 1] - y[1]) + gear.damping_nm_s * 0.7, 1e-9);
    EXPECT_EQ(pushed.acceleration[0], free.acceleration[0]);  // a torque reaches the link through the spring only
    EXPECT_NEAR(pushed.driven_acceleration()[0] - free.driven_acceleration()[0], 1.0 / 0.2, 1e-9);
  }
}

}  // namespace
}  // namespace quasilpv::testing
