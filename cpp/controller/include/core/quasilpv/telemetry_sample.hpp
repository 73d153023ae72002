// What one step of the loop read and computed: plain data, whoever takes it away.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "quasilpv/failsafe.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// One sample of a run. `quasilpv::link` sends it as `telemetry_v2` (docs/reference/messages.md).
struct TelemetrySample {
  std::int64_t seq = 0;
  ControllerState state = ControllerState::kInit;
  std::uint32_t flags = kStepHealthy;  ///< StepFlag bits
  bool realtime = false;               ///< memory locked and SCHED_FIFO
  int premises = 0;                    ///< of the design model
  std::int64_t drops = 0;              ///< samples that the ring could not take so far
  std::int64_t step_ns = 0;            ///< duration of the step
  JointArray reference_angle_rad{};    ///< of the path, without what a joining segment adds
  JointArray reference_speed_rad_s{};
  JointArray reference_acceleration_rad_s2{};
  JointArray measured_angle_rad{};  ///< what the law controls
  JointArray measured_speed_rad_s{};
  GearReading gears{};
  JointArray estimated_angle_rad{};
  JointArray estimated_speed_rad_s{};
  JointArray estimated_disturbance{};
  JointArray filtered_disturbance{};
  JointArray integral_error_rad_s{};
  JointArray commanded_torque_nm{};  ///< before limits
  JointArray applied_torque_nm{};    ///< what the plant got
  std::array<double, kMaxPremises> premise{};
  double membership_sum = 1.0;  ///< MonitorReport, as the two that follow
  double premise_excess = 0.0;
  double lyapunov_rad2 = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace quasilpv
