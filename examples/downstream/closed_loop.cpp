// closed_loop ARTIFACT TRAJECTORY SCENARIO: a controller against a simulated plant, in a project of one's own.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <iostream>

#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/simulation.hpp"
#include "quasilpv/trajectory.hpp"

namespace {

void run(const char* artifact_path, const char* trajectory_path, const char* scenario_path) {
  const quasilpv::Artifact artifact = quasilpv::Artifact::load(artifact_path);
  const quasilpv::Trajectory trajectory = quasilpv::Trajectory::load(trajectory_path);
  const quasilpv::Scenario scenario = quasilpv::Scenario::load(scenario_path);
  quasilpv::Controller controller(artifact);
  const quasilpv::RunRecord record = quasilpv::run_closed_loop(scenario, controller, trajectory);

  const quasilpv::Record::Column& angle = record.samples["angle_rad"];
  const quasilpv::Record::Column& reference = record.samples["reference_angle_rad"];
  double worst = 0.0;
  for (std::size_t i = 0; i < angle.values.size(); ++i) {
    worst = std::max(worst, std::abs(angle.values[i] - reference.values[i]));
  }
  std::printf("%s: %zu samples of %g s, largest angle error %.17g rad\n", artifact.name().c_str(), angle.samples(),
              record.sample_period_s, worst);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: closed_loop ARTIFACT TRAJECTORY SCENARIO\n";
    return 2;
  }
  try {
    run(argv[1], argv[2], argv[3]);
  } catch (const std::exception& error) {
    std::cerr << "closed_loop: " << error.what() << '\n';
    return 2;
  }
  return 0;
}
