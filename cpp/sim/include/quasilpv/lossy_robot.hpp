// A simulated robot behind a bad wire: packets are lost, repeated, late and out of order, in virtual time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "quasilpv/link_robot.hpp"
#include "quasilpv/plant_session.hpp"
#include "quasilpv/robot.hpp"

namespace quasilpv {

/// What a wire does to packets, independently of each other; probabilities per packet.
struct WireFaults {
  double loss = 0.0;
  double duplication = 0.0;     ///< a second copy, with a delay of its own
  double reordering = 0.0;      ///< 1.5 sample periods late, so that its successor overtakes it
  double jitter_periods = 0.0;  ///< every delay is uniform in [0, jitter] sample periods; at most 0.5
  std::uint64_t random_seed = 1;
};

/// What one direction of a wire did; sent - lost + duplicated = delivered + in_flight.
struct WireCounters {
  std::int64_t sent = 0;
  std::int64_t lost = 0;
  std::int64_t duplicated = 0;
  std::int64_t reordered = 0;
  std::int64_t delivered = 0;
  std::int64_t in_flight = 0;
};

/// The Robot of a PlantSession at the other end of two bad wires, one for measurements and one for commands.
///
/// Messages are encoded, checked and counted by two ends of a Link, as between two processes; only the time is virtual:
/// equal arguments give equal runs, at the speed of the machine. The plant measures at k T. Command k acts from its
/// arrival; of two that arrive within one sample the newer one acts; without one the last torque stays in force (there
/// is no watchdog: see run_plant()). With no faults it gives the samples of PlantRobot and a scenario without delay.
/// To be driven by run_controller() in lock-step pace. RT-UNSAFE throughout.
class LossyRobot final : public Robot {
 public:
  /// What looks at the plant at the beginning of every sample.
  using Observer = std::function<void(const PlantSession&)>;

  /// `session` must outlive this. INIT-ONLY. Throws InputError if a probability is not in [0, 1] or the jitter not in
  /// [0, 0.5].
  LossyRobot(PlantSession& session, const WireIdentity& identity, const WireFaults& faults, Observer observer = {});
  ~LossyRobot() override;

  /// Lets virtual time pass to the next measurement that arrives; false if that is none the controller may use.
  bool read(RobotReading& reading, std::int64_t timeout_ns) noexcept override;
  void write(const RobotCommand& command) noexcept override;
  /// kEnd after the last sample, and after a failure.
  RobotRequest take_request() noexcept override;
  std::int64_t take_longest_foreign_run() noexcept override;

  /// Why the plant could not be integrated further; empty if it could.
  const std::string& failure() const noexcept { return failure_; }

  WireCounters measurement_wire() const noexcept;
  WireCounters command_wire() const noexcept;
  /// What the controller's end received, and the plant's.
  const LinkCounters& measurements() const noexcept;
  const LinkCounters& commands() const noexcept;

 private:
  class Wire;
  class End;

  bool is_over() const noexcept { return !failure_.empty() || session_.seq() >= session_.samples(); }
  void begin_sample();
  void finish_sample();
  void receive_command();

  PlantSession& session_;
  Observer observer_;
  std::int64_t period_ns_;
  std::int64_t now_ns_ = 0;
  std::unique_ptr<Wire> to_controller_;
  std::unique_ptr<Wire> to_plant_;
  std::unique_ptr<End> controller_;
  std::unique_ptr<End> plant_;
  LinkRobot controller_side_;
  std::int64_t last_command_seq_ = -1;
  JointArray torque_{};  // acts on the current sample from delay_ns_ on
  std::int64_t delay_ns_ = 0;
  std::string failure_;
};

}  // namespace quasilpv
