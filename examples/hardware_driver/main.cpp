// A controller with its driver in one process: hardware_driver ARTIFACT TRAJECTORY SECONDS
#include <exception>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "drive_robot.hpp"
#include "quasilpv/decimal.hpp"
#include "quasilpv/exit_codes.hpp"
#include "quasilpv/loop.hpp"
#include "quasilpv/run_controller.hpp"
#include "quasilpv/telemetry_publisher.hpp"

namespace {

using namespace quasilpv;  // NOLINT(google-build-using-namespace): this file is the program

int run(const std::string& artifact_path, const std::string& trajectory_path, double seconds) {
  constexpr int kPriority = 80;
  constexpr double kInertia = 8.0;
  const Artifact artifact = Artifact::load(artifact_path);
  const Trajectory trajectory = Trajectory::load(trajectory_path);
  const double period_s = artifact.sample_period_s();

  LoopSettings settings;
  settings.safe_action = SafeAction::kGravity;
  settings.bumpless_start = true;
  settings.realtime = enter_realtime(kPriority).complete();
  ControlLoop loop(artifact, trajectory, settings);
  TelemetryPublisher telemetry(nullptr, period_s, artifact.joints(),
                               std::make_unique<OutputFile>("hardware_driver.csv", "record", "hardware_driver",
                                                            std::vector{artifact_path, trajectory_path}));
  loop.publish_to(&telemetry.ring());

  const Reference start = trajectory.evaluate(0.0);
  std::vector<hardware_driver::BenchDrive> drives;
  for (std::size_t j = 0; j < static_cast<std::size_t>(artifact.joints()); ++j) {
    drives.emplace_back(kInertia, start.angle[j], period_s);
  }
  hardware_driver::DriveRobot robot(std::move(drives), period_s, static_cast<std::int64_t>(seconds / period_s));
  ControllerRunSettings run_settings;
  run_settings.pace = Pace::kRealTime;
  run_settings.exit_on_fault = true;
  const ControllerRunReport report = run_controller(loop, robot, run_settings, install_stop_signals());
  telemetry.stop();
  std::cout << to_string(report.end) << ", " << to_string(loop.state()) << ": " << report.commands << " commands, "
            << loop.predicted_steps() << " predicted steps, " << report.deadline_overruns << " overruns\n";
  return loop.state() == ControllerState::kFault ? kExitFaultStop : kExitDone;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: hardware_driver ARTIFACT TRAJECTORY SECONDS\n";
    return kExitBadInput;
  }
  try {
    return run(argv[1], argv[2], quasilpv::parse_number(argv[3], "hardware_driver", "SECONDS", 0.01, 86400.0));
  } catch (const std::exception& error) {
    std::cerr << "hardware_driver: " << error.what() << '\n';
    return kExitBadInput;
  }
}
