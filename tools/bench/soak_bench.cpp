// soak_bench ARTIFACT TRAJECTORY SCENARIO SECONDS: the loop over a bad wire, run after run of the scenario until so
// many seconds were simulated; fails unless every packet was counted once, nothing latched a fault and memory stayed
// flat.
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "main.hpp"
#include "quasilpv/lossy_robot.hpp"
#include "quasilpv/run_controller.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

constexpr double kTolerableGrowthBytes = 1 << 20;

void require(bool holds, const std::string& what) {
  if (!holds) {
    throw std::runtime_error("soak: " + what);
  }
}

double resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t total = 0;
  std::int64_t resident = 0;
  file >> total >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

void require_exact(const WireCounters& wire, const LinkCounters& link) {
  require(wire.sent - wire.lost + wire.duplicated == wire.delivered + wire.in_flight, "a packet vanished on the wire");
  require(link.accepted + link.duplicates + link.old == wire.delivered, "a packet was not counted exactly once");
}

struct Totals {
  std::int64_t samples = 0;
  std::int64_t predicted = 0;
  std::int64_t runs = 0;
  WireCounters measurements;
  std::vector<double> cpu_ns_per_sample;  ///< of every run
};

/// One run of the scenario; the wires differ from run to run.
void run_once(const Artifact& artifact, const Trajectory& trajectory, const Scenario& scenario, Totals& totals) {
  const std::int64_t start_ns = clock_ns(CLOCK_PROCESS_CPUTIME_ID);
  const WireFaults faults{0.05, 0.01, 0.01, 0.5, static_cast<std::uint64_t>(totals.runs + 1)};
  ControlLoop loop(artifact, trajectory, {});
  PlantSession session(scenario, artifact.sample_period_s());
  LossyRobot robot(session, {totals.runs + 1, artifact.hash_prefix(), artifact.joints()}, faults);
  const std::atomic<bool> stop{false};
  run_controller(loop, robot, {}, stop);
  require(robot.failure().empty(), robot.failure());
  require(loop.faults() == 0, std::string("fault: ") + to_string(loop.cause()));
  require_exact(robot.measurement_wire(), robot.measurements());
  require_exact(robot.command_wire(), robot.commands());
  require(loop.predicted_steps() == loop.steps() - robot.measurements().accepted, "a lost sample was not predicted");
  const auto cpu_ns = static_cast<double>(clock_ns(CLOCK_PROCESS_CPUTIME_ID) - start_ns);
  totals.cpu_ns_per_sample.push_back(cpu_ns / static_cast<double>(session.seq()));
  totals.samples += session.seq();
  totals.predicted += loop.predicted_steps();
  totals.measurements.lost += robot.measurement_wire().lost;
  totals.measurements.duplicated += robot.measurement_wire().duplicated;
  totals.measurements.reordered += robot.measurement_wire().reordered;
  ++totals.runs;
}

nlohmann::json measure(const std::vector<std::string>& arguments) {
  const Artifact artifact = Artifact::load(arguments[0]);
  const Trajectory trajectory = Trajectory::load(arguments[1]);
  const Scenario scenario = Scenario::load(arguments[2]);
  const double wanted_s = parse_number(arguments[3], "command line", "SECONDS", 1e-3, 1e6);
  Totals totals;
  run_once(artifact, trajectory, scenario, totals);
  const double early_bytes = resident_bytes();
  while (static_cast<double>(totals.samples) * artifact.sample_period_s() < wanted_s) {
    run_once(artifact, trajectory, scenario, totals);
  }
  const double growth_bytes = resident_bytes() - early_bytes;
  require(totals.predicted > 0 && totals.measurements.lost > 0, "nothing was observed");
  require(growth_bytes < kTolerableGrowthBytes, "memory grew by " + std::to_string(growth_bytes) + " bytes");
  return {{"samples", totals.samples},
          {"runs", totals.runs},
          {"simulated_s", static_cast<double>(totals.samples) * artifact.sample_period_s()},
          {"predicted", totals.predicted},
          {"lost", totals.measurements.lost},
          {"duplicated", totals.measurements.duplicated},
          {"reordered", totals.measurements.reordered},
          {"memory_growth_bytes", growth_bytes},
          {"cpu_ns_per_sample", totals.cpu_ns_per_sample}};
}

}  // namespace

int main(int argc, char** argv) {
  return run_benchmark(argc, argv, {"ARTIFACT", "TRAJECTORY", "SCENARIO", "SECONDS"}, measure);
}
