#include "quasilpv/elastic_tree_plant.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "plants/registry.hpp"
#include "quasilpv/decimal.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

// See SerialArm: below this fraction of a diagonal entry, accelerations have lost all but four of their digits.
constexpr double kSmallestPivotRatio = 1e-12;

JointArray joint_array(Plant::ConstVector x) noexcept {
  JointArray array{};
  std::copy(x.data(), x.data() + x.size(), array.begin());
  return array;
}

Eigen::Map<const TreeVector> as_vector(const JointArray& values, int joints) noexcept {
  return {values.data(), joints};
}

std::uint32_t read_sensors(const Field& plant) {
  std::uint32_t sensors = kNoGearSensor;
  const std::string side = plant["encoder_side"].text();
  if (side == "motor" || side == "both") {
    sensors |= kMotorAngle;
  }
  if (side == "link" || side == "both") {
    sensors |= kLinkAngle;
  }
  if (sensors == kNoGearSensor) {
    plant["encoder_side"].fail_choice({"motor", "link", "both"});
  }
  if (plant.has("torque_sensor") && plant["torque_sensor"].boolean()) {
    sensors |= kJointTorque;
  }
  return sensors;
}

ElasticTreeParameters read_elastic_tree(const Field& field) {
  field.only({"kind", "label", "gravity_m_s2", "encoder_side", "torque_sensor", "joints", "tool"});
  ElasticTreeParameters parameters;
  parameters.label = field["label"].text();
  parameters.tree = read_tree(field);
  parameters.sensors = read_sensors(field);
  const Field joints = field["joints"];
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const Field joint = joints.at(k);
    joint.only({"name", "kind", "rotation", "translation_m", "axis", "mass_kg", "first_moment_kg_m", "rotational_kg_m2",
                "rotor_inertia_kg_m2", "friction_viscous_nm_s", "friction_coulomb_nm", "coulomb_speed_rad_s",
                "stiffness_nm_rad", "damping_nm_s"});
    parameters.gears.push_back({joint["stiffness_nm_rad"].positive(), joint["damping_nm_s"].non_negative(),
                                joint["rotor_inertia_kg_m2"].positive()});
    parameters.friction.push_back({joint["friction_viscous_nm_s"].non_negative(),
                                   joint["friction_coulomb_nm"].non_negative(),
                                   joint["coulomb_speed_rad_s"].positive()});
    parameters.tree.joints[k].rotor_inertia_kg_m2 = 0.0;
  }
  return parameters;
}

}  // namespace

ElasticTreePlant::ElasticTreePlant(ElasticTreeParameters parameters)
    : parameters_(std::move(parameters)),
      dynamics_(parameters_.tree),
      stiffness_(dynamics_.joints()),
      damping_(dynamics_.joints()),
      rotor_(dynamics_.joints()) {
  for (int k = 0; k < joints(); ++k) {
    const ElasticGear& gear = parameters_.gears[static_cast<std::size_t>(k)];
    stiffness_[k] = gear.stiffness_nm_rad;
    damping_[k] = gear.damping_nm_s;
    rotor_[k] = gear.rotor_inertia_kg_m2;
  }
}

Eigen::VectorXd ElasticTreePlant::initial_state(const JointArray& angle, const JointArray& speed) const {
  const int n = joints();
  const TreeVector rest = TreeVector::Zero(n);
  TreeVector weight(n);
  dynamics_.torque_at_rest(angle.data(), rest.data(), weight.data());
  Eigen::VectorXd y(size());
  y << as_vector(angle, n), as_vector(angle, n) + weight.cwiseQuotient(stiffness_), as_vector(speed, n),
      as_vector(speed, n);
  return y;
}

TreeVector ElasticTreePlant::spring_torque(ConstVector y) const noexcept {
  const int n = joints();
  return stiffness_.cwiseProduct(y.segment(n, n) - y.head(n)) +
         damping_.cwiseProduct(y.segment(3 * n, n) - y.segment(2 * n, n));
}

TreeVector ElasticTreePlant::friction(ConstVector motor_speed) const noexcept {
  TreeVector torque(joints());
  for (int k = 0; k < joints(); ++k) {
    const JointFriction& own = parameters_.friction[static_cast<std::size_t>(k)];
    torque[k] =
        own.viscous_nm_s * motor_speed[k] + own.coulomb_nm * std::tanh(motor_speed[k] / own.coulomb_speed_rad_s);
  }
  return torque;
}

void ElasticTreePlant::residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept {
  const int n = joints();
  const JointArray external = external_torque().at(t);
  const TreeVector spring = spring_torque(y);
  TreeVector moving(n);
  dynamics_.inverse_dynamics(y.data(), y.data() + 2 * n, y_dot.data() + 2 * n, moving.data());
  residual.head(2 * n) = y_dot.head(2 * n) - y.tail(2 * n);
  residual.segment(2 * n, n) = moving - spring - as_vector(external, n);
  residual.tail(n) = rotor_.cwiseProduct(y_dot.tail(n)) + friction(y.tail(n)) + spring - as_vector(torque(), n);
}

void ElasticTreePlant::jacobian(double /*t*/, double c_j, ConstVector y, ConstVector y_dot,
                                Matrix jacobian) const noexcept {
  const int n = joints();
  TreeMatrix by_coordinate;
  TreeMatrix by_speed;
  dynamics_.derivatives(y.data(), y.data() + 2 * n, y_dot.data() + 2 * n, by_coordinate, by_speed);
  jacobian.setZero();
  jacobian.topLeftCorner(2 * n, 2 * n).diagonal().setConstant(c_j);
  jacobian.topRightCorner(2 * n, 2 * n).diagonal().setConstant(-1.0);
  jacobian.block(2 * n, 0, n, n) = by_coordinate;
  jacobian.block(2 * n, 2 * n, n, n) = by_speed + c_j * dynamics_.inertia(y.data());
  for (int k = 0; k < n; ++k) {
    const JointFriction& own = parameters_.friction[static_cast<std::size_t>(k)];
    const double slope = 1.0 / std::cosh(std::min(std::abs(y[3 * n + k]) / own.coulomb_speed_rad_s, 300.0));
    const double rubbing = own.viscous_nm_s + own.coulomb_nm / own.coulomb_speed_rad_s * slope * slope;
    const int link = 2 * n + k;
    const int motor = 3 * n + k;
    jacobian(link, k) += stiffness_[k];
    jacobian(link, n + k) -= stiffness_[k];
    jacobian(link, 2 * n + k) += damping_[k];
    jacobian(link, 3 * n + k) -= damping_[k];
    jacobian(motor, k) -= stiffness_[k];
    jacobian(motor, n + k) += stiffness_[k];
    jacobian(motor, 2 * n + k) -= damping_[k];
    jacobian(motor, 3 * n + k) += damping_[k] + rubbing + c_j * rotor_[k];
  }
}

void ElasticTreePlant::derivative(double t, ConstVector y, Vector y_dot) const {
  const int n = joints();
  const TreeMatrix mass = dynamics_.inertia(y.data());
  const Eigen::LLT<TreeMatrix> cholesky(mass);
  const TreeVector pivots = cholesky.matrixLLT().diagonal().array().square();
  if (cholesky.info() != Eigen::Success || !(pivots.array() > kSmallestPivotRatio * mass.diagonal().array()).all()) {
    throw PlantError("elastic tree '" + parameters_.label +
                     "': singular mass matrix of the links at t = " + format_number(t) + " s");
  }
  const JointArray external = external_torque().at(t);
  const TreeVector spring = spring_torque(y);
  const TreeVector rest = TreeVector::Zero(n);
  TreeVector motion(n);
  dynamics_.inverse_dynamics(y.data(), y.data() + 2 * n, rest.data(), motion.data());
  y_dot.head(2 * n) = y.tail(2 * n);
  y_dot.segment(2 * n, n) = cholesky.solve(spring + as_vector(external, n) - motion);
  y_dot.tail(n) = (as_vector(torque(), n) - friction(y.tail(n)) - spring).cwiseQuotient(rotor_);
}

PlantSample ElasticTreePlant::sample(double t, ConstVector y) const {
  const int n = joints();
  Eigen::VectorXd y_dot(size());
  derivative(t, y, y_dot);
  PlantSample sample{joint_array(y.head(n)), joint_array(y.segment(2 * n, n)), joint_array(y_dot.segment(2 * n, n)),
                     external_torque().at(t)};
  sample.motors = MotorSample{joint_array(y.segment(n, n)), joint_array(y.tail(n)), joint_array(y_dot.tail(n)),
                              joint_array(spring_torque(y)), parameters_.sensors};
  return sample;
}

double ElasticTreePlant::energy(ConstVector y) const {
  const int n = joints();
  const TreeVector deflection = y.segment(n, n) - y.head(n);
  return dynamics_.energy(y.data(), y.data() + 2 * n) + 0.5 * deflection.dot(stiffness_.cwiseProduct(deflection)) +
         0.5 * y.tail(n).dot(rotor_.cwiseProduct(y.tail(n)));
}

namespace plants {

PlantKind elastic_tree() {
  return {"elastic-tree", [](const Field& plant) -> PlantFactory {
            return [parameters = read_elastic_tree(plant)] { return std::make_unique<ElasticTreePlant>(parameters); };
          }};
}

}  // namespace plants
}  // namespace quasilpv
