#include "quasilpv/equation_plant.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

constexpr int kNewtonSteps = 50;
constexpr double kNewtonTolerance = 1e-13;  // of the step, relative to the state

}  // namespace

EquationPlant::EquationPlant(const SystemArtifact& artifact, const std::vector<double>& parameter,
                             const SystemDisturbance& disturbance)
    : artifact_(artifact),
      disturbance_(disturbance),
      states_(static_cast<int>(artifact.states().size())),
      differential_(artifact.differential()) {
  std::copy(parameter.begin(), parameter.end(), values_.begin() + states_ + static_cast<int>(artifact.inputs().size()));
}

void EquationPlant::set_input(const double* input) noexcept {
  std::copy_n(input, artifact_.inputs().size(), values_.begin() + states_);
}

Eigen::VectorXd EquationPlant::differential() const {
  Eigen::VectorXd mask = Eigen::VectorXd::Zero(states_);
  mask.head(differential_).setOnes();
  return mask;
}

Eigen::VectorXd EquationPlant::absolute_tolerance(double tolerance) const {
  Eigen::VectorXd scaled = Eigen::VectorXd::Constant(states_, tolerance);
  for (int k = 0; k < states_; ++k) {
    const SystemSignal& state = artifact_.states()[static_cast<std::size_t>(k)];
    const double width = std::max(std::abs(state.low), std::abs(state.high));
    if (std::isfinite(width) && width > 0.0) {
      scaled[k] *= width;
    }
  }
  return scaled;
}

EquationPlant::Signals EquationPlant::signals(double t, ConstVector y, ConstVector y_dot) const noexcept {
  std::array<double, kMaxStates + kMaxInputs> added{};
  disturbance_.add(t, added.data());
  Signals values = values_;
  for (std::size_t k = 0; k < artifact_.inputs().size(); ++k) {
    values[static_cast<std::size_t>(states_) + k] += added[static_cast<std::size_t>(states_) + k];
  }
  const int rates = artifact_.signals();
  for (int k = 0; k < states_; ++k) {
    values[static_cast<std::size_t>(k)] = y[k];
    values[static_cast<std::size_t>(rates) + static_cast<std::size_t>(k)] =
        y_dot[k] - added[static_cast<std::size_t>(k)];
  }
  return values;
}

void EquationPlant::residual(double t, ConstVector y, ConstVector y_dot, Vector residual) const noexcept {
  artifact_.residual().evaluate({nullptr, nullptr, nullptr, signals(t, y, y_dot).data()}, residual.data());
}

void EquationPlant::jacobian(double t, double c_j, ConstVector y, ConstVector y_dot, Matrix jacobian) const noexcept {
  const Signals values = signals(t, y, y_dot);
  std::array<double, kMaxProgramStack> row;
  for (int i = 0; i < states_; ++i) {
    artifact_.jacobian()[static_cast<std::size_t>(i)].evaluate({nullptr, nullptr, nullptr, values.data()}, row.data());
    for (int j = 0; j < states_; ++j) {
      jacobian(i, j) =
          c_j * row[static_cast<std::size_t>(j)] + row[static_cast<std::size_t>(states_) + static_cast<std::size_t>(j)];
    }
  }
}

void EquationPlant::partials(const Signals& values, Eigen::MatrixXd& by_rate,
                             Eigen::MatrixXd& by_state) const noexcept {
  std::array<double, kMaxProgramStack> row;
  for (int i = 0; i < states_; ++i) {
    artifact_.jacobian()[static_cast<std::size_t>(i)].evaluate({nullptr, nullptr, nullptr, values.data()}, row.data());
    for (int j = 0; j < states_; ++j) {
      by_rate(i, j) = row[static_cast<std::size_t>(j)];
      by_state(i, j) = row[static_cast<std::size_t>(states_) + static_cast<std::size_t>(j)];
    }
  }
}

void EquationPlant::derivative(double t, ConstVector y, Vector y_dot) const {
  Eigen::VectorXd consistent = y;
  make_consistent(t, consistent, y_dot);
}

// NOLINTNEXTLINE(performance-unnecessary-value-param): Eigen passes writable references by value.
void EquationPlant::make_consistent(double t, Vector y, Vector y_dot) const {
  const int algebraic = states_ - differential_;
  Eigen::VectorXd rest(states_);
  Eigen::MatrixXd by_rate(states_, states_);
  Eigen::MatrixXd by_state(states_, states_);
  y_dot.setZero();
  bool solved = algebraic == 0;
  for (int step = 0; step < kNewtonSteps && !solved; ++step) {
    const Signals values = signals(t, y, y_dot);
    artifact_.residual().evaluate({nullptr, nullptr, nullptr, values.data()}, rest.data());
    partials(values, by_rate, by_state);
    const Eigen::MatrixXd slope = by_state.bottomRightCorner(algebraic, algebraic);
    const Eigen::VectorXd change = slope.partialPivLu().solve(rest.tail(algebraic));
    if (!change.allFinite()) {
      break;
    }
    y.tail(algebraic) -= change;
    solved = change.norm() <= kNewtonTolerance * (1.0 + y.tail(algebraic).norm());
  }
  if (!solved) {
    throw PlantError("the algebraic equations have no solution near the state at t = " + std::to_string(t) + " s");
  }
  const Signals values = signals(t, y, y_dot);
  artifact_.residual().evaluate({nullptr, nullptr, nullptr, values.data()}, rest.data());
  partials(values, by_rate, by_state);
  const Eigen::MatrixXd inertia = by_rate.topLeftCorner(differential_, differential_);
  y_dot.head(differential_) = inertia.partialPivLu().solve(-rest.head(differential_));
  if (!y_dot.allFinite()) {
    throw PlantError("E is singular or the state is not finite at t = " + std::to_string(t) + " s");
  }
}

}  // namespace quasilpv
