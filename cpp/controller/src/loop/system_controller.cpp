#include "quasilpv/system_controller.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace quasilpv {

SystemController::SystemController(SystemArtifact artifact)
    : artifact_(std::move(artifact)),
      gain_(static_cast<Eigen::Index>(artifact_.inputs().size()), artifact_.differential()),
      state_(artifact_.differential()),
      input_(static_cast<Eigen::Index>(artifact_.inputs().size())),
      scaled_(artifact_.differential()) {
  reset();
}

void SystemController::reset() noexcept {
  for (std::size_t k = 0; k < artifact_.inputs().size(); ++k) {
    last_[k] = artifact_.inputs()[k].trim;
  }
}

SystemReport SystemController::step(const double* state, const double* parameter) noexcept {
  const std::vector<SystemSignal>& states = artifact_.states();
  const std::vector<SystemSignal>& inputs = artifact_.inputs();
  const std::vector<SystemSignal>& parameters = artifact_.parameters();
  SystemReport report;
  report.input = last_;
  report.commanded = last_;
  bool finite = true;
  for (std::size_t k = 0; k < states.size(); ++k) {
    signal_[k] = state[k] - states[k].trim;
    finite = finite && std::isfinite(signal_[k]);
  }
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const double value = parameters[k].known ? parameter[k] - parameters[k].trim : 0.0;
    signal_[states.size() + inputs.size() + k] = value;
    finite = finite && std::isfinite(value);
  }
  if (!finite) {
    report.flags |= kSignalInvalid;
    return report;
  }
  artifact_.schedule().evaluate({nullptr, nullptr, nullptr, signal_.data()}, report.premise.data());
  if (artifact_.gain().evaluate_sized(report.premise.data(), gain_)) {
    report.flags |= kSystemPremiseOutside;
  }
  for (Eigen::Index k = 0; k < state_.size(); ++k) {
    state_[k] = signal_[static_cast<std::size_t>(k)];
  }
  scaled_.noalias() = artifact_.lyapunov_inverse() * state_;
  report.level = state_.dot(scaled_);
  if (!(report.level <= 1.0)) {
    report.flags |= kOutsideRegion;
  }
  input_.noalias() = gain_ * state_;
  if (!input_.allFinite()) {
    report.flags |= kInputNotFinite;
    return report;
  }
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const double wanted = input_[static_cast<Eigen::Index>(k)];
    const double given = std::clamp(wanted, inputs[k].low, inputs[k].high);
    if (given != wanted) {
      report.flags |= kInputSaturated;
    }
    report.commanded[k] = wanted + inputs[k].trim;
    report.input[k] = given + inputs[k].trim;
  }
  last_ = report.input;
  return report;
}

}  // namespace quasilpv
