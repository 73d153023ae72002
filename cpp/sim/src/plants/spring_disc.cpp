#include "quasilpv/spring_disc.hpp"

#include <cmath>
#include <utility>

#include "plants/plant_table.hpp"
#include "quasilpv/decimal.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

constexpr double kContactForceTolerance = 1.0;  // N

}  // namespace

void check_spring_disc(const SpringDiscParameters& disc, const std::string& source, const std::string& path) {
  const auto require = [&](bool holds, const char* field, double got, const char* expected) {
    if (!holds || !std::isfinite(got)) {
      throw InputError(source, path + "." + field, format_number(got), expected);
    }
  };
  require(disc.mass_kg > 0.0, "mass_kg", disc.mass_kg, "a number > 0");
  require(disc.radius_m > 0.0, "radius_m", disc.radius_m, "a number > 0");
  require(disc.inertia_kg_m2 > 0.0, "inertia_kg_m2", disc.inertia_kg_m2, "a number > 0 (indefinite inertia)");
  require(disc.inertia_uncertainty_per_kg >= 0.0, "inertia_uncertainty_per_kg", disc.inertia_uncertainty_per_kg,
          "a number >= 0");
  require(disc.stiffness_n_m >= 0.0, "stiffness_n_m", disc.stiffness_n_m, "a number >= 0");
  require(disc.cubic_stiffness_n_m3 >= 0.0, "cubic_stiffness_n_m3", disc.cubic_stiffness_n_m3, "a number >= 0");
  require(disc.damping_n_s_m >= 0.0, "damping_n_s_m", disc.damping_n_s_m, "a number >= 0");
}

SpringDisc::SpringDisc(SpringDiscParameters parameters) : parameters_(std::move(parameters)) {
  check_spring_disc(parameters_, "spring-disc", "'" + parameters_.label + "'");
  const double r = parameters_.radius_m;
  inertia_ = 1.0 / (1.0 / parameters_.inertia_kg_m2 + parameters_.inertia_uncertainty_per_kg / (r * r));
  mobility_ = 1.0 / parameters_.mass_kg + r * r / inertia_;
}

Eigen::VectorXd SpringDisc::differential() const { return Eigen::Vector4d(1.0, 1.0, 1.0, 0.0); }

Eigen::VectorXd SpringDisc::absolute_tolerance(double tolerance) const {
  return Eigen::Vector4d(tolerance, tolerance, tolerance, kContactForceTolerance);
}

Eigen::VectorXd SpringDisc::initial_state(const JointArray& angle, const JointArray& speed) const {
  const double r = parameters_.radius_m;
  return Eigen::Vector4d(r * angle[0], r * speed[0], speed[0], 0.0);
}

double SpringDisc::spring_and_damper_force(double position, double speed) const noexcept {
  return (parameters_.stiffness_n_m + parameters_.cubic_stiffness_n_m3 * position * position) * position +
         parameters_.damping_n_s_m * speed;
}

double SpringDisc::contact_force(double t, ConstVector y) const noexcept {
  const double driving = parameters_.radius_m / inertia_ * joint_torque(t)[0];
  return (spring_and_damper_force(y[0], y[1]) / parameters_.mass_kg + driving) / mobility_;
}

void SpringDisc::residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept {
  const double force = spring_and_damper_force(y[0], y[1]);
  const double torque = joint_torque(t)[0];
  const double r = parameters_.radius_m;
  residual[0] = y_dot[0] - y[1];
  residual[1] = parameters_.mass_kg * y_dot[1] + force - y[3];
  residual[2] = inertia_ * y_dot[2] + r * y[3] - torque;
  residual[3] = mobility_ * y[3] - force / parameters_.mass_kg - r / inertia_ * torque;
}

void SpringDisc::jacobian(double /*t*/, double c_j, ConstVector y, ConstVector /*y_dot*/,
                          Matrix jacobian) const noexcept {
  const double stiffness = parameters_.stiffness_n_m + 3.0 * parameters_.cubic_stiffness_n_m3 * y[0] * y[0];
  const double damping = parameters_.damping_n_s_m;
  const double mass = parameters_.mass_kg;
  jacobian << c_j, -1.0, 0.0, 0.0,                     //
      stiffness, c_j * mass + damping, 0.0, -1.0,      //
      0.0, 0.0, c_j * inertia_, parameters_.radius_m,  //
      -stiffness / mass, -damping / mass, 0.0, mobility_;
}

void SpringDisc::derivative(double t, ConstVector y, Vector y_dot) const {
  const double contact = contact_force(t, y);
  y_dot[0] = y[1];
  y_dot[1] = (contact - spring_and_damper_force(y[0], y[1])) / parameters_.mass_kg;
  y_dot[2] = (joint_torque(t)[0] - parameters_.radius_m * contact) / inertia_;
  y_dot[3] = 0.0;
}

void SpringDisc::make_consistent(double t, Vector y, Vector y_dot) const {
  const double impulse = slip(y) / mobility_;
  y[1] -= impulse / parameters_.mass_kg;
  y[2] += impulse * parameters_.radius_m / inertia_;
  y[3] = contact_force(t, y);
  derivative(t, y, y_dot);
}

PlantSample SpringDisc::sample(double t, ConstVector y) const {
  Eigen::Vector4d y_dot;
  derivative(t, y, y_dot);
  return {{y[0] / parameters_.radius_m}, {y[2]}, {y_dot[2]}, external_torque().at(t)};
}

namespace plants {

PlantKind spring_disc() {
  using P = SpringDiscParameters;
  PlantTable<P> disc;
  disc.text("label", &P::label);
  disc.size("mass_kg", &P::mass_kg);
  disc.size("radius_m", &P::radius_m);
  disc.size("inertia_kg_m2", &P::inertia_kg_m2);
  disc.number("inertia_uncertainty_per_kg", &P::inertia_uncertainty_per_kg);
  disc.number("stiffness_n_m", &P::stiffness_n_m);
  disc.number("cubic_stiffness_n_m3", &P::cubic_stiffness_n_m3);
  disc.number("damping_n_s_m", &P::damping_n_s_m);
  return disc.kind<SpringDisc>("spring-disc", check_spring_disc);
}

}  // namespace plants
}  // namespace quasilpv
