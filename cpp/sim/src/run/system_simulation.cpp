#include "quasilpv/system_simulation.hpp"

namespace quasilpv {
namespace {

struct Columns {
  explicit Columns(Record& record, const SystemArtifact& artifact, std::int64_t samples)
      : record_(record),
        time_(record.add_column("time_s")),
        state_(record.add_column("state", artifact.states().size())),
        measured_(record.add_column("measured", artifact.states().size())),
        input_(record.add_column("input", artifact.inputs().size())),
        commanded_(record.add_column("commanded", artifact.inputs().size())),
        level_(record.add_column("level")),
        flags_(record.add_column("flags")),
        premises_(artifact.gain().premises()),
        seen_(artifact.states().size()) {
    if (premises_ > 0) {
      premise_ = record.add_column("premise", static_cast<std::size_t>(premises_));
    }
    record.reserve(static_cast<std::size_t>(samples));
  }

  void append(const SystemSession& session, const SystemReport& report) {
    record_.append(time_, session.time_s());
    record_.append(state_, session.truth().data());
    for (std::size_t k = 0; k < seen_.size(); ++k) {
      seen_[k] = session.artifact().is_measured(k) ? session.measured()[k] : report.state[k];
    }
    record_.append(measured_, seen_.data());
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
  std::size_t time_, state_, measured_, input_, commanded_, level_, flags_;
  int premises_;
  std::size_t premise_ = 0;
  std::vector<double> seen_;
};

}  // namespace

SystemRun simulate_system(const SystemArtifact& artifact, const SystemScenario& scenario) {
  SystemController controller(artifact);
  SystemSession session(artifact, scenario);
  if (!scenario.estimate.empty()) {
    controller.reset(scenario.estimate.data());
  }
  SystemRun run;
  Columns columns(run.samples, artifact, scenario.samples);
  while (session.seq() < session.samples()) {
    const double* measured = session.measured().data();
    const SystemReport report = controller.step(measured, measured + artifact.states().size());
    run.flags |= report.flags;
    columns.append(session, report);
    session.advance(report.input);
  }
  run.exit = session.exit();
  return run;
}

std::vector<double> disturbance_of(const SystemArtifact& artifact, const SystemScenario& scenario) {
  const std::size_t width = artifact.states().size() + artifact.inputs().size();
  const std::size_t samples = static_cast<std::size_t>(scenario.samples);
  SystemDisturbance disturbance(scenario.disturbances);
  std::vector<double> values(samples * width, 0.0);
  for (std::size_t k = 0; k < samples; ++k) {
    const double time_s = static_cast<double>(k) * artifact.sample_period_s();
    disturbance.draw();
    disturbance.begin(time_s);
    disturbance.add(time_s, values.data() + k * width);
  }
  return values;
}

}  // namespace quasilpv
