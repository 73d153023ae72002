#include "quasilpv/system_session.hpp"

#include <algorithm>
#include <string>

#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

SystemScenario checked(const SystemArtifact& artifact, SystemScenario scenario) {
  const auto require_size = [](const char* field, std::size_t got, std::size_t expected) {
    if (got != expected) {
      throw InputError("experiment", field, std::to_string(got) + " values", std::to_string(expected));
    }
  };
  const std::size_t states = artifact.states().size();
  require_size("start", scenario.start.size(), states);
  require_size("parameter", scenario.parameter.size(), artifact.parameters().size());
  const std::size_t estimates = static_cast<std::size_t>(artifact.differential());
  require_size("estimate", scenario.estimate.empty() ? estimates : scenario.estimate.size(), estimates);
  for (const auto& [field, values] : {std::pair("noise", &scenario.sensors.noise),  //
                                      std::pair("quantum", &scenario.sensors.quantum)}) {
    require_size(field, values->empty() ? states : values->size(), states);
  }
  if (!(scenario.delay_s >= 0.0 && scenario.delay_s <= artifact.sample_period_s())) {
    throw InputError("experiment", "delay_s", std::to_string(scenario.delay_s), "0 to one sample period");
  }
  return scenario;
}

std::vector<double> deviations(const std::vector<double>& values, const std::vector<SystemSignal>& signals) {
  std::vector<double> result(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    result[k] = values[k] - signals[k].trim;
  }
  return result;
}

}  // namespace

SystemSession::SystemSession(const SystemArtifact& artifact, const SystemScenario& scenario)
    : artifact_(artifact),
      disturbance_(scenario.disturbances),
      plant_(artifact, deviations(checked(artifact, scenario).parameter, artifact.parameters()), disturbance_),
      integrator_(make_integrator(scenario.integrator, plant_, artifact.sample_period_s())),
      sensors_(scenario.sensors),
      noise_(scenario.sensors.seed),
      delay_s_(scenario.delay_s),
      samples_(scenario.samples),
      slope_(static_cast<Eigen::Index>(scenario.start.size())),
      truth_(scenario.start.size()) {
  const std::vector<double> start = deviations(scenario.start, artifact.states());
  y_ = Eigen::Map<const Eigen::VectorXd>(start.data(), static_cast<Eigen::Index>(start.size()));
  for (std::size_t k = 0; k < artifact.parameters().size(); ++k) {
    measured_[start.size() + k] = artifact.parameters()[k].known ? scenario.parameter[k] : 0.0;
  }
  for (std::size_t k = 0; k < artifact.inputs().size(); ++k) {
    input_[k] = artifact.inputs()[k].trim;
  }
  observe();
}

void SystemSession::observe() {
  disturbance_.draw();
  disturbance_.begin(time_s());
  plant_.make_consistent(time_s(), y_, slope_);
  for (std::size_t i = 0; i < truth_.size(); ++i) {
    const SystemSignal& state = artifact_.states()[i];
    const double deviation = y_[static_cast<Eigen::Index>(i)];
    truth_[i] = deviation + state.trim;
    if (!exit_ && (deviation < state.low || deviation > state.high)) {
      exit_ = DomainExit{time_s(), static_cast<int>(i)};
      samples_ = seq_ + 1;
    }
    if (!artifact_.is_measured(i)) {
      continue;
    }
    const double noise = sensors_.noise.empty() ? 0.0 : sensors_.noise[i];
    const double noisy = noise > 0.0 ? truth_[i] + noise * noise_() : truth_[i];
    measured_[i] = quantise(noisy, sensors_.quantum.empty() ? 0.0 : sensors_.quantum[i]);
  }
}

void SystemSession::set_input(const InputArray& input) noexcept {
  InputArray deviation{};
  for (std::size_t k = 0; k < artifact_.inputs().size(); ++k) {
    deviation[k] = input[k] - artifact_.inputs()[k].trim;
  }
  plant_.set_input(deviation.data());
  input_ = input;
}

void SystemSession::advance(const InputArray& input, double delay_s) {
  const double from_s = time_s();
  const double to_s = from_s + sample_period_s();
  const double wanted_s = std::min(from_s + std::max(delay_s, 0.0), to_s);
  const double jump_s = wanted_s - from_s > kShortestInterval ? wanted_s : from_s;
  ++seq_;
  if (seq_ >= samples_) {
    set_input(input);  // the last sample: nobody looks at where it leads
    return;
  }
  integrate(from_s, jump_s);
  set_input(input);
  integrate(jump_s, to_s);
  observe();
}

void SystemSession::integrate(double from_s, double to_s) {
  while (to_s - from_s > kShortestInterval) {
    const double edge_s = disturbance_.next_edge(from_s, to_s);
    disturbance_.begin(from_s);
    integrator_->advance(from_s, edge_s, y_);
    from_s = edge_s;
  }
}

}  // namespace quasilpv
