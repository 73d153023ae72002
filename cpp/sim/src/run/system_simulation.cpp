#include "quasilpv/system_simulation.hpp"

#include <cmath>
#include <memory>

#include "quasilpv/equation_plant.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

void require_size(const char* field, std::size_t got, std::size_t expected) {
  if (got != expected) {
    throw InputError("experiment", field, std::to_string(got) + " values", std::to_string(expected));
  }
}

std::vector<double> deviations(const std::vector<double>& values, const std::vector<SystemSignal>& signals) {
  std::vector<double> result(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    result[k] = values[k] - signals[k].trim;
  }
  return result;
}

// The last input acts on for `delay_s`, then the new one.
class HeldInput {
 public:
  HeldInput(const SystemArtifact& artifact, const SystemExperiment& experiment)
      : artifact_(artifact),
        delay_s_(experiment.delay_s),
        plant_(artifact, deviations(experiment.parameter, artifact.parameters())),
        integrator_(make_integrator(experiment.integrator, plant_, artifact.sample_period_s())) {}

  EquationPlant& plant() { return plant_; }

  void advance(double from_s, const std::array<double, kMaxInputs>& input, Eigen::VectorXd& y) {
    const double to_s = from_s + artifact_.sample_period_s();
    if (delay_s_ > 0.0) {
      integrator_->advance(from_s, std::min(from_s + delay_s_, to_s), y);
    }
    std::array<double, kMaxInputs> deviation{};
    for (std::size_t k = 0; k < artifact_.inputs().size(); ++k) {
      deviation[k] = input[k] - artifact_.inputs()[k].trim;
    }
    const double acts_from_s = from_s + delay_s_;
    if (acts_from_s < to_s) {
      plant_.set_input(deviation.data());
      integrator_->advance(acts_from_s, to_s, y);
    } else {
      plant_.set_input(deviation.data());
    }
  }

 private:
  const SystemArtifact& artifact_;
  double delay_s_;
  EquationPlant plant_;
  std::unique_ptr<Integrator> integrator_;
};

struct Columns {
  explicit Columns(Record& record, const SystemArtifact& artifact, std::int64_t samples)
      : record_(record),
        time_(record.add_column("time_s")),
        state_(record.add_column("state", artifact.states().size())),
        input_(record.add_column("input", artifact.inputs().size())),
        commanded_(record.add_column("commanded", artifact.inputs().size())),
        level_(record.add_column("level")),
        flags_(record.add_column("flags")),
        premises_(artifact.gain().premises()) {
    if (premises_ > 0) {
      premise_ = record.add_column("premise", static_cast<std::size_t>(premises_));
    }
    record.reserve(static_cast<std::size_t>(samples));
  }

  void append(double time_s, const double* state, const SystemReport& report) {
    record_.append(time_, time_s);
    record_.append(state_, state);
    record_.append(input_, report.input.data());
    record_.append(commanded_, report.commanded.data());
    record_.append(level_, report.level);
    record_.append(flags_, static_cast<double>(report.flags));
    if (premises_ > 0) {
      record_.append(premise_, report.premise.data());
    }
  }

 private:
  Record& record_;
  std::size_t time_, state_, input_, commanded_, level_, flags_;
  int premises_;
  std::size_t premise_ = 0;
};

}  // namespace

SystemRun simulate_system(const SystemArtifact& artifact, const SystemExperiment& experiment) {
  require_size("start", experiment.start.size(), artifact.states().size());
  require_size("parameter", experiment.parameter.size(), artifact.parameters().size());
  const double period_s = artifact.sample_period_s();
  if (!(experiment.delay_s >= 0.0 && experiment.delay_s <= period_s)) {
    throw InputError("experiment", "delay_s", std::to_string(experiment.delay_s), "0 to one sample period");
  }
  SystemController controller(artifact);
  HeldInput loop(artifact, experiment);
  const std::vector<double> start = deviations(experiment.start, artifact.states());
  Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(start.data(), static_cast<Eigen::Index>(start.size()));
  Eigen::VectorXd slope(y.size());
  SystemRun run;
  Columns columns(run.samples, artifact, experiment.samples);
  std::vector<double> measured(start.size());
  for (std::int64_t k = 0; k < experiment.samples; ++k) {
    const double time_s = static_cast<double>(k) * period_s;
    loop.plant().make_consistent(time_s, y, slope);
    for (std::size_t i = 0; i < measured.size(); ++i) {
      measured[i] = y[static_cast<Eigen::Index>(i)] + artifact.states()[i].trim;
    }
    const SystemReport report = controller.step(measured.data(), experiment.parameter.data());
    run.flags |= report.flags;
    columns.append(time_s, measured.data(), report);
    for (std::size_t i = 0; i < start.size() && !run.exit; ++i) {
      const double value = y[static_cast<Eigen::Index>(i)];
      if (value < artifact.states()[i].low || value > artifact.states()[i].high) {
        run.exit = DomainExit{time_s, artifact.states()[i].name};
      }
    }
    if (run.exit) {
      break;
    }
    loop.advance(time_s, report.input, y);
  }
  return run;
}

}  // namespace quasilpv
