// rnea SCENARIO STATES ROUNDS: inverse dynamics of the scenario's arm, planar or in space, by Pinocchio's recursive
// Newton-Euler algorithm. The competitor of inverse_dynamics_bench and step_bench; tools/bench/bench_pinocchio.py
// builds it when it is needed (a minute of compilation), outside the main build.
#include <iostream>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <string>

#include "arm_states.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace): this file is the program

/// Links along x at zero angles, which then point down: gravity acts along +x. Joints turn about z. A scenario's moment
/// of inertia is about the joint axis, Pinocchio's about the centre of mass.
pinocchio::Model planar_arm(const nlohmann::json& plant) {
  pinocchio::Model model;
  model.gravity.linear() = Eigen::Vector3d(plant.at("gravity_m_s2").get<double>(), 0.0, 0.0);
  pinocchio::JointIndex parent = 0;
  pinocchio::SE3 placement = pinocchio::SE3::Identity();
  for (const nlohmann::json& link : plant.at("links")) {
    const double mass = link.at("mass_kg").get<double>();
    const double com = link.at("com_m").get<double>();
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
    inertia(2, 2) = link.at("inertia_kg_m2").get<double>() - mass * com * com;
    parent = model.addJoint(parent, pinocchio::JointModelRZ(), placement, "joint" + std::to_string(parent + 1));
    model.appendBodyToJoint(parent, pinocchio::Inertia(mass, Eigen::Vector3d(com, 0.0, 0.0), inertia));
    placement.translation() = Eigen::Vector3d(link.at("length_m").get<double>(), 0.0, 0.0);
  }
  return model;
}

Eigen::Matrix3d rows(const nlohmann::json& matrix) {
  Eigen::Matrix3d result;
  for (int i = 0; i < 3; ++i) {
    result.row(i) = to_vector(matrix.at(static_cast<std::size_t>(i)));
  }
  return result;
}

/// A chain about axes of its own, z where that is the axis: the fastest joint Pinocchio has for it.
pinocchio::Model chain(const nlohmann::json& plant) {
  pinocchio::Model model;
  model.gravity.linear() = to_vector(plant.at("gravity_m_s2"));
  pinocchio::JointIndex parent = 0;
  for (const nlohmann::json& joint : plant.at("joints")) {
    if (joint.at("kind") == "prismatic") {
      throw std::runtime_error("rnea: a joint that slides is not part of this benchmark");
    }
    const pinocchio::SE3 placement(rows(joint.at("rotation")), Eigen::Vector3d(to_vector(joint.at("translation_m"))));
    const Eigen::Vector3d axis = to_vector(joint.at("axis"));
    const std::string name = joint.at("name").get<std::string>();
    if (axis == Eigen::Vector3d::UnitZ()) {
      parent = model.addJoint(parent, pinocchio::JointModelRZ(), placement, name);
    } else {
      parent = model.addJoint(parent, pinocchio::JointModelRevoluteUnaligned(axis), placement, name);
    }
    const double mass = joint.at("mass_kg").get<double>();
    const Eigen::Vector3d com = Eigen::Vector3d(to_vector(joint.at("first_moment_kg_m"))) / mass;
    const Eigen::Matrix3d about_com = rows(joint.at("rotational_kg_m2")) -
                                      mass * (com.squaredNorm() * Eigen::Matrix3d::Identity() - com * com.transpose());
    model.appendBodyToJoint(parent, pinocchio::Inertia(mass, com, about_com));
    model.armature[static_cast<Eigen::Index>(parent) - 1] = joint.at("rotor_inertia_kg_m2").get<double>();
  }
  return model;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: rnea SCENARIO STATES ROUNDS\n";
    return 2;
  }
  try {
    const nlohmann::json plant = read_json(argv[1]).at("plant");
    const pinocchio::Model model = plant.at("kind") == "tree" ? chain(plant) : planar_arm(plant);
    pinocchio::Data data(model);
    const std::vector<ArmState> states = read_states(argv[2]);
    const auto torque = [&](const ArmState& state) -> const Eigen::VectorXd& {
      return pinocchio::rnea(model, data, state.angle, state.speed, state.acceleration);
    };
    const Timing timing = time_calls(
        states.size(), std::stoi(argv[3]), [] {}, [&](std::size_t i) { keep(torque(states[i])); });
    const nlohmann::json report{{"timing", to_json(timing)}, {"torques_nm", torques_at(states, torque)}};
    std::cout << report << '\n';
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
  return 0;
}
