// The hardware seam: joint positions in, joint torques out. One implementation per robot.
#pragma once

#include <cstdint>

#include "quasilpv/failsafe.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// What a robot measured at one sample.
struct RobotReading {
  std::int64_t seq = 0;       ///< sample index k since the robot started, so its time is k T; a gap is a lost sample
  std::int64_t taken_ns = 0;  ///< monotonic_ns() of the measurement
  JointArray angle_rad{};     ///< NaN marks an encoder that failed: the observer then predicts
  JointArray speed_rad_s{};   ///< read only by laws that need a measured speed; 0 otherwise
  GearReading gears{};        ///< motor_angle_rad, link_angle_rad, joint_torque_nm, as far as there are sensors
};

/// What a robot shall do from now on.
struct RobotCommand {
  std::int64_t seq = 0;  ///< of the reading it answers
  JointArray torque_nm{};
  ControllerState state = ControllerState::kInit;
  std::uint32_t flags = kStepHealthy;  ///< StepFlag bits
};

/// What the robot's side asks of the controller besides torques.
enum class RobotRequest {
  kNone,
  kEnd,         ///< the run is over
  kResetFault,  ///< leave a latched fault, if its cause is gone
  kRefuse       ///< there can be no run: the two sides do not run in the same way
};

/// What the controller tells besides torques.
enum class ControllerNews { kStarted, kFault, kEnded };

/// A robot as the control thread sees it. run_controller() calls all members from one thread; it never lets a torque
/// out that is not finite or beyond the artifact's torque and slew limits, and it never answers one reading twice
/// (except in lock-step, where a repeated reading is answered with the same command).
///
/// A driver author implements read() and write(). The robot is the pacemaker: read() returns when its next sample is
/// there, be it a field bus cycle or a Pacer on the absolute grid of the monotonic clock. Members may block only as
/// stated, and neither allocate, lock, throw nor log. The drive needs a watchdog of its own: it must brake when write()
/// has not been called for a few sample periods, because no code of this library runs after a crash.
class Robot {
 public:
  Robot() = default;
  virtual ~Robot() = default;
  Robot(const Robot&) = delete;
  Robot& operator=(const Robot&) = delete;

  /// Waits for a reading not returned before, at most `timeout_ns` (0: polls); may return earlier without one. Several
  /// pending: the newest. Returns whether `reading` was written.
  virtual bool read(RobotReading& reading, std::int64_t timeout_ns) noexcept = 0;

  /// Hands over the torques; does not wait for the drive. A failure is the driver's to count: the drive's own watchdog
  /// handles it.
  virtual void write(const RobotCommand& command) noexcept = 0;

  /// The oldest request not taken yet. By default there is none.
  virtual RobotRequest take_request() noexcept { return RobotRequest::kNone; }

  /// Why this run cannot go on, as far as only the robot's side can know; asked for once per reading, and once more at
  /// the end of a run. By default nothing speaks against it.
  virtual FaultCause take_fault() noexcept { return FaultCause::kNone; }

  /// Longest run of readings since the last call that were not meant for this controller. By default 0: a wire of its
  /// own carries nothing foreign.
  virtual std::int64_t take_longest_foreign_run() noexcept { return 0; }

  /// What happened, at which sample, and why (a FaultCause, or 0). By default nobody listens.
  virtual void announce(ControllerNews /*news*/, std::int64_t /*seq*/, FaultCause /*cause*/) noexcept {}
};

}  // namespace quasilpv
