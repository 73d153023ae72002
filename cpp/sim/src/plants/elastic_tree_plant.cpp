#include "quasilpv/elastic_tree_plant.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "plants/read_friction.hpp"
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

Eigen::Map<const TreeVector> as_vector(const JointArray& values, Eigen::Index joints) noexcept {
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

TorqueLoop read_torque_loop(const Field& plant) {
  TorqueLoop loop;
  if (!plant.has("torque_loop") || plant["torque_loop"].is_null()) {
    return loop;
  }
  const Field field = plant["torque_loop"];
  field.only({"gain", "lag_s"});
  loop.gain = field["gain"].positive();
  if (loop.gain < 1.0) {
    field["gain"].fail(format_number(loop.gain), "at least 1");
  }
  loop.lag_s = field["lag_s"].non_negative();
  return loop;
}

// How a torque sensor errs, where there is one.
double read_of_torque_sensor(const Field& joint, const char* name, std::uint32_t sensors) {
  const double value = joint.has(name) ? joint[name].non_negative() : 0.0;
  if (value > 0.0 && (sensors & kJointTorque) == 0) {
    joint[name].fail(format_number(value), "0 without torque_sensor");
  }
  return value;
}

ElasticTreeParameters read_elastic_tree(const Field& field) {
  field.only({"kind", "label", "gravity_m_s2", "encoder_side", "torque_sensor", "torque_loop", "joints", "tool"});
  ElasticTreeParameters parameters;
  parameters.label = field["label"].text();
  parameters.tree = read_tree(field);
  parameters.sensors = read_sensors(field);
  parameters.torque_loop = read_torque_loop(field);
  const Field joints = field["joints"];
  for (std::size_t k = 0; k < joints.size(); ++k) {
    const Field joint = joints.at(k);
    joint.only({"name", "kind", "rotation", "translation_m", "axis", "mass_kg", "first_moment_kg_m", "rotational_kg_m2",
                "rotor_inertia_kg_m2", "friction_viscous_nm_s", "friction_coulomb_nm", "coulomb_speed_rad_s",
                "stiffness_nm_rad", "damping_nm_s", "stick_slip", "torque_noise_nm", "torque_quantum_nm"});
    parameters.gears.push_back({joint["stiffness_nm_rad"].positive(), joint["damping_nm_s"].non_negative(),
                                joint["rotor_inertia_kg_m2"].positive()});
    parameters.torque_noise_nm[k] = read_of_torque_sensor(joint, "torque_noise_nm", parameters.sensors);
    parameters.torque_quantum_nm[k] = read_of_torque_sensor(joint, "torque_quantum_nm", parameters.sensors);
    parameters.friction.push_back(read_friction(joint));
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
      rotor_(dynamics_.joints()),
      friction_(parameters_.friction, 3 * dynamics_.joints(), (lags() ? 5 : 4) * dynamics_.joints()) {
  for (int k = 0; k < joints(); ++k) {
    const ElasticGear& gear = parameters_.gears[static_cast<std::size_t>(k)];
    stiffness_[k] = gear.stiffness_nm_rad;
    damping_[k] = gear.damping_nm_s;
    rotor_[k] = gear.rotor_inertia_kg_m2;
  }
}

Eigen::VectorXd ElasticTreePlant::absolute_tolerance(double tolerance) const {
  Eigen::VectorXd tolerances = Plant::absolute_tolerance(tolerance);
  friction_.loosen(tolerances);
  return tolerances;
}

Eigen::VectorXd ElasticTreePlant::initial_state(const JointArray& angle, const JointArray& speed) const {
  const Eigen::Index n = joints();
  const TreeVector rest = TreeVector::Zero(n);
  TreeVector weight(n);
  dynamics_.torque_at_rest(angle.data(), rest.data(), weight.data());
  Eigen::VectorXd y = Eigen::VectorXd::Zero(size());
  y.head(4 * n) << as_vector(angle, n), as_vector(angle, n) + weight.cwiseQuotient(stiffness_), as_vector(speed, n),
      as_vector(speed, n);
  if (lags()) {
    y.segment(4 * n, n) = weight;
  }
  return y;
}

TreeVector ElasticTreePlant::spring_torque(ConstVector y) const noexcept {
  const Eigen::Index n = joints();
  return stiffness_.cwiseProduct(y.segment(n, n) - y.head(n)) +
         damping_.cwiseProduct(y.segment(3 * n, n) - y.segment(2 * n, n));
}

TreeVector ElasticTreePlant::wanted_torque(const TreeVector& spring) const noexcept {
  const double gain = parameters_.torque_loop.gain;
  return gain * as_vector(torque(), joints()) + (1.0 - gain) * (spring + as_vector(torque_error(), joints()));
}

void ElasticTreePlant::residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept {
  const Eigen::Index n = joints();
  const JointArray external = external_torque().at(t);
  const TreeVector spring = spring_torque(y);
  TreeVector moving(n);
  dynamics_.inverse_dynamics(y.data(), y.data() + 2 * n, y_dot.data() + 2 * n, moving.data());
  const TreeVector wanted = wanted_torque(spring);
  residual.head(2 * n) = y_dot.head(2 * n) - y.segment(2 * n, 2 * n);
  residual.segment(2 * n, n) = moving - spring - as_vector(external, n);
  residual.segment(3 * n, n) = rotor_.cwiseProduct(y_dot.segment(3 * n, n)) + friction_.torque(y) + spring;
  if (lags()) {
    residual.segment(3 * n, n) -= y.segment(4 * n, n);
    residual.segment(4 * n, n) = parameters_.torque_loop.lag_s * y_dot.segment(4 * n, n) + y.segment(4 * n, n) - wanted;
  } else {
    residual.segment(3 * n, n) -= wanted;
  }
  const int bristles = friction_.bristles();
  friction_.bristle_rates(y, residual.tail(bristles));
  residual.tail(bristles) = y_dot.tail(bristles) - residual.tail(bristles);
}

void ElasticTreePlant::jacobian(double /*t*/, double c_j, ConstVector y, ConstVector y_dot,
                                Matrix jacobian) const noexcept {
  const Eigen::Index n = joints();
  TreeMatrix by_coordinate;
  TreeMatrix by_speed;
  dynamics_.derivatives(y.data(), y.data() + 2 * n, y_dot.data() + 2 * n, by_coordinate, by_speed);
  jacobian.setZero();
  jacobian.topLeftCorner(2 * n, 2 * n).diagonal().setConstant(c_j);
  jacobian.block(0, 2 * n, 2 * n, 2 * n).diagonal().setConstant(-1.0);
  jacobian.block(2 * n, 0, n, n) = by_coordinate;
  jacobian.block(2 * n, 2 * n, n, n) = by_speed + c_j * dynamics_.inertia(y.data());
  const TorqueLoop& loop = parameters_.torque_loop;
  // Of the motor's own equation, in which the wanted torque stands where drives do not lag.
  const double share = lags() ? 1.0 : loop.gain;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index link = 2 * n + k;
    const Eigen::Index motor = 3 * n + k;
    jacobian(link, k) += stiffness_[k];
    jacobian(link, n + k) -= stiffness_[k];
    jacobian(link, 2 * n + k) += damping_[k];
    jacobian(link, 3 * n + k) -= damping_[k];
    jacobian(motor, k) -= share * stiffness_[k];
    jacobian(motor, n + k) += share * stiffness_[k];
    jacobian(motor, 2 * n + k) -= share * damping_[k];
    jacobian(motor, 3 * n + k) += share * damping_[k] + c_j * rotor_[k];
    if (lags()) {
      const Eigen::Index drive = 4 * n + k;
      jacobian(motor, drive) -= 1.0;
      jacobian(drive, k) += (1.0 - loop.gain) * stiffness_[k];
      jacobian(drive, n + k) -= (1.0 - loop.gain) * stiffness_[k];
      jacobian(drive, 2 * n + k) += (1.0 - loop.gain) * damping_[k];
      jacobian(drive, 3 * n + k) -= (1.0 - loop.gain) * damping_[k];
      jacobian(drive, drive) += 1.0 + c_j * loop.lag_s;
    }
  }
  friction_.add_jacobian(y, c_j, 3 * n, jacobian);
}

void ElasticTreePlant::derivative(double t, ConstVector y, Vector y_dot) const {
  const Eigen::Index n = joints();
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
  y_dot.head(2 * n) = y.segment(2 * n, 2 * n);
  y_dot.segment(2 * n, n) = cholesky.solve(spring + as_vector(external, n) - motion);
  const TreeVector wanted = wanted_torque(spring);
  const TreeVector driving = lags() ? TreeVector(y.segment(4 * n, n)) : wanted;
  y_dot.segment(3 * n, n) = (driving - friction_.torque(y) - spring).cwiseQuotient(rotor_);
  if (lags()) {
    y_dot.segment(4 * n, n) = (wanted - driving) / parameters_.torque_loop.lag_s;
  }
  friction_.bristle_rates(y, y_dot.tail(friction_.bristles()));
}

PlantSample ElasticTreePlant::sample(double t, ConstVector y) const {
  const Eigen::Index n = joints();
  Eigen::VectorXd y_dot(size());
  derivative(t, y, y_dot);
  PlantSample sample{joint_array(y.head(n)), joint_array(y.segment(2 * n, n)), joint_array(y_dot.segment(2 * n, n)),
                     external_torque().at(t)};
  sample.motors = MotorSample{joint_array(y.segment(n, n)),
                              joint_array(y.segment(3 * n, n)),
                              joint_array(y_dot.segment(3 * n, n)),
                              joint_array(spring_torque(y)),
                              parameters_.sensors,
                              parameters_.torque_noise_nm,
                              parameters_.torque_quantum_nm};
  return sample;
}

JointArray ElasticTreePlant::mobility(double /*t*/, ConstVector /*y*/) {
  return joint_array(parameters_.torque_loop.gain * rotor_.cwiseInverse());
}

double ElasticTreePlant::energy(ConstVector y) const {
  const Eigen::Index n = joints();
  const TreeVector deflection = y.segment(n, n) - y.head(n);
  return dynamics_.energy(y.data(), y.data() + 2 * n) + 0.5 * deflection.dot(stiffness_.cwiseProduct(deflection)) +
         0.5 * y.segment(3 * n, n).dot(rotor_.cwiseProduct(y.segment(3 * n, n))) + friction_.energy(y);
}

namespace plants {

PlantKind elastic_tree() {
  return {"elastic-tree", [](const Field& plant) -> PlantFactory {
            return [parameters = read_elastic_tree(plant)] { return std::make_unique<ElasticTreePlant>(parameters); };
          }};
}

}  // namespace plants
}  // namespace quasilpv
