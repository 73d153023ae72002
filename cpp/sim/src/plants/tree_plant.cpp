#include "quasilpv/tree_plant.hpp"

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

TreePlantParameters read_tree_plant(const Field& field) {
  // Where the tool is, no motion depends on.
  field.only({"kind", "label", "gravity_m_s2", "joints", "lag_s", "tool"});
  TreePlantParameters parameters;
  parameters.label = field["label"].text();
  parameters.tree = read_tree(field);
  parameters.lag_s = field.has("lag_s") ? field["lag_s"].non_negative() : 0.0;
  const Field joints = field["joints"];
  for (std::size_t k = 0; k < joints.size(); ++k) {
    joints.at(k).only({"name", "kind", "rotation", "translation_m", "axis", "mass_kg", "first_moment_kg_m",
                       "rotational_kg_m2", "rotor_inertia_kg_m2", "friction_viscous_nm_s", "friction_coulomb_nm",
                       "coulomb_speed_rad_s", "stick_slip"});
    parameters.friction.push_back(read_friction(joints.at(k)));
  }
  return parameters;
}

}  // namespace

TreePlant::TreePlant(TreePlantParameters parameters)
    : parameters_(std::move(parameters)),
      dynamics_(parameters_.tree),
      friction_(parameters_.friction, dynamics_.joints(), (lags() ? 3 : 2) * dynamics_.joints()) {}

Eigen::VectorXd TreePlant::absolute_tolerance(double tolerance) const {
  Eigen::VectorXd tolerances = Plant::absolute_tolerance(tolerance);
  friction_.loosen(tolerances);
  return tolerances;
}

Eigen::VectorXd TreePlant::initial_state(const JointArray& angle, const JointArray& speed) const {
  const Eigen::Index n = joints();
  Eigen::VectorXd y = Eigen::VectorXd::Zero(size());
  y.head(n) = Eigen::Map<const Eigen::VectorXd>(angle.data(), n);
  y.segment(n, n) = Eigen::Map<const Eigen::VectorXd>(speed.data(), n);
  if (lags()) {
    const TreeVector rest = TreeVector::Zero(n);
    dynamics_.torque_at_rest(angle.data(), rest.data(), y.data() + 2 * n);
  }
  return y;
}

TreeVector TreePlant::acting_torque(double t, ConstVector y) const noexcept {
  const Eigen::Index n = joints();
  if (!lags()) {
    const JointArray torque = joint_torque(t);
    return Eigen::Map<const Eigen::VectorXd>(torque.data(), n);
  }
  const JointArray external = external_torque().at(t);
  return y.segment(2 * n, n) + Eigen::Map<const Eigen::VectorXd>(external.data(), n);
}

void TreePlant::residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept {
  const Eigen::Index n = joints();
  residual.head(n) = y_dot.head(n) - y.segment(n, n);
  TreeVector moving(n);
  dynamics_.inverse_dynamics(y.data(), y.data() + n, y_dot.data() + n, moving.data());
  residual.segment(n, n) = moving + friction_.torque(y) - acting_torque(t, y);
  if (lags()) {
    residual.segment(2 * n, n) = parameters_.lag_s * y_dot.segment(2 * n, n) + y.segment(2 * n, n) -
                                 Eigen::Map<const Eigen::VectorXd>(torque().data(), n);
  }
  const int bristles = friction_.bristles();
  friction_.bristle_rates(y, residual.tail(bristles));
  residual.tail(bristles) = y_dot.tail(bristles) - residual.tail(bristles);
}

void TreePlant::jacobian(double /*t*/, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept {
  const Eigen::Index n = joints();
  TreeMatrix by_coordinate;
  TreeMatrix by_speed;
  dynamics_.derivatives(y.data(), y.data() + n, y_dot.data() + n, by_coordinate, by_speed);
  jacobian.setZero();
  jacobian.topLeftCorner(n, n).diagonal().setConstant(c_j);
  jacobian.block(0, n, n, n).diagonal().setConstant(-1.0);
  jacobian.block(n, 0, n, n) = by_coordinate;
  jacobian.block(n, n, n, n) = by_speed + c_j * dynamics_.inertia(y.data());
  if (lags()) {
    jacobian.block(n, 2 * n, n, n).diagonal().setConstant(-1.0);
    jacobian.block(2 * n, 2 * n, n, n).diagonal().setConstant(1.0 + c_j * parameters_.lag_s);
  }
  friction_.add_jacobian(y, c_j, n, jacobian);
}

void TreePlant::derivative(double t, ConstVector y, Vector y_dot) const {
  const Eigen::Index n = joints();
  const TreeMatrix mass = dynamics_.inertia(y.data());
  const Eigen::LLT<TreeMatrix> cholesky(mass);
  const TreeVector pivots = cholesky.matrixLLT().diagonal().array().square();
  if (cholesky.info() != Eigen::Success || !(pivots.array() > kSmallestPivotRatio * mass.diagonal().array()).all()) {
    throw PlantError("tree '" + parameters_.label + "': singular mass matrix at t = " + format_number(t) + " s");
  }
  const TreeVector rest = TreeVector::Zero(n);
  TreeVector motion(n);
  dynamics_.inverse_dynamics(y.data(), y.data() + n, rest.data(), motion.data());
  y_dot.head(n) = y.segment(n, n);
  y_dot.segment(n, n) = cholesky.solve(acting_torque(t, y) - motion - friction_.torque(y));
  if (lags()) {
    y_dot.segment(2 * n, n) =
        (Eigen::Map<const Eigen::VectorXd>(torque().data(), n) - y.segment(2 * n, n)) / parameters_.lag_s;
  }
  friction_.bristle_rates(y, y_dot.tail(friction_.bristles()));
}

PlantSample TreePlant::sample(double t, ConstVector y) const {
  const Eigen::Index n = joints();
  Eigen::VectorXd y_dot(size());
  derivative(t, y, y_dot);
  return {joint_array(y.head(n)), joint_array(y.segment(n, n)), joint_array(y_dot.segment(n, n)),
          external_torque().at(t)};
}

JointArray TreePlant::mobility(double /*t*/, ConstVector y) {
  const Eigen::Index n = joints();
  const TreeMatrix inverse = dynamics_.inertia(y.data()).llt().solve(TreeMatrix::Identity(n, n));
  return joint_array(inverse.diagonal());
}

namespace plants {

PlantKind tree() {
  return {"tree", [](const Field& plant) -> PlantFactory {
            return [parameters = read_tree_plant(plant)] { return std::make_unique<TreePlant>(parameters); };
          }};
}

}  // namespace plants
}  // namespace quasilpv
