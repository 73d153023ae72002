// A simulated robot in the controller's own process: the loopback of the hardware seam.
#pragma once

#include <string>

#include "quasilpv/plant_session.hpp"
#include "quasilpv/robot.hpp"

namespace quasilpv {

/// The Robot of a PlantSession, in lock-step and without a transport: read() measures sample k, write() integrates over
/// it. With run_controller() it gives the samples of run_closed_loop(). RT-UNSAFE throughout: the plant allocates.
class PlantRobot final : public Robot {
 public:
  /// `session` must outlive this. INIT-ONLY.
  explicit PlantRobot(PlantSession& session) noexcept : session_(session) {}

  /// Returns at once: false if the sample was read already, or the run is over.
  bool read(RobotReading& reading, std::int64_t timeout_ns) noexcept override;
  /// Ignores a command that answers no reading of the current sample.
  void write(const RobotCommand& command) noexcept override;
  /// kEnd after the last sample, and after a failure.
  RobotRequest take_request() noexcept override;
  /// kPlantFailed after a failure.
  FaultCause take_fault() noexcept override { return failure_.empty() ? FaultCause::kNone : FaultCause::kPlantFailed; }

  /// Why the plant could not be integrated further; empty if it could.
  const std::string& failure() const noexcept { return failure_; }

 private:
  bool is_over() const noexcept { return !failure_.empty() || session_.seq() >= session_.samples(); }

  PlantSession& session_;
  std::int64_t last_read_ = -1;
  std::string failure_;
};

}  // namespace quasilpv
