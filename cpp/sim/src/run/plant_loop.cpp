#include "quasilpv/plant_loop.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "quasilpv/decimal.hpp"
#include "quasilpv/limiter.hpp"
#include "quasilpv/run_columns.hpp"
#include "run/plant_run.hpp"

namespace quasilpv {
namespace {

class RunColumns {
 public:
  RunColumns(Record& record, const PlantSession& session)
      : record_(record),
        seq_(record.add_column("seq")),
        time_(record.add_column("time_s")),
        plant_(record, session.joints(), session.truth().motors.has_value()),
        torque_(record.add_column("torque_nm", static_cast<std::size_t>(session.joints()))),
        delay_(record.add_column("command_delay_s")) {
    record.reserve(static_cast<std::size_t>(session.samples()));
  }

  void append(const PlantSession& session, const JointArray& torque, double delay_s) {
    record_.append(seq_, static_cast<double>(session.seq()));
    record_.append(time_, static_cast<double>(session.seq()) * session.sample_period_s());
    plant_.append(session.truth());
    record_.append(torque_, torque);
    record_.append(delay_, delay_s);
  }

 private:
  Record& record_;
  std::size_t seq_, time_;
  PlantColumns plant_;
  std::size_t torque_, delay_;
};

/// What PlantRun asks of a robot.
class RobotSide {
 public:
  using Command = command_v2;
  using Values = JointArray;

  RobotSide(PlantSession& session, const PlantRunSettings& settings, Record* record)
      : session_(session), settings_(settings) {
    if (record != nullptr) {
      columns_.emplace(*record, session);
    }
  }

  double sample_period_s() const noexcept { return session_.sample_period_s(); }
  std::int64_t samples() const noexcept { return session_.samples(); }
  std::int64_t seq() const noexcept { return session_.seq(); }

  measurement_v3 measurement() const {
    const Measurement& measured = session_.measure(session_.seq());
    measurement_v3 message{};
    message.seq = measured.seq;
    std::copy(measured.angle.begin(), measured.angle.end(), message.angle_rad);
    std::copy(measured.speed.begin(), measured.speed.end(), message.speed_rad_s);
    set_gears(measured.gears, message);
    return message;
  }

  static JointArray values(const command_v2& command) noexcept {
    JointArray torque;
    std::copy(std::begin(command.torque_nm), std::end(command.torque_nm), torque.begin());
    return torque;
  }

  std::string refusal(const command_v2& command) const {
    for (std::size_t j = 0; j < static_cast<std::size_t>(session_.joints()); ++j) {
      const double torque = command.torque_nm[j];
      const double limit = settings_.torque_limit_nm ? (*settings_.torque_limit_nm)[j] : kLargestTorqueNm;
      if (!(std::abs(torque) <= limit)) {  // NaN is not
        return "torque_nm[" + std::to_string(j) + "] of sample " + std::to_string(command.seq) + " is " +
               format_number(torque) + ", beyond " + format_number(limit);
      }
    }
    return "";
  }

  const JointArray& in_force() const noexcept { return session_.torque(); }

  JointArray brake() const noexcept {
    JointArray torque{};
    for (std::size_t j = 0; j < static_cast<std::size_t>(session_.joints()); ++j) {
      torque[j] = -settings_.brake_nm_s[j] * session_.truth().driven_speed()[j];
    }
    return torque;
  }

  void append(const JointArray& torque, double delay_s) {
    if (columns_) {
      columns_->append(session_, torque, delay_s);
    }
  }

  void advance(const JointArray& torque) { session_.advance(session_.seq(), torque); }
  void advance(const JointArray& torque, double delay_s) { session_.advance(session_.seq(), torque, delay_s); }

  static void announce(Link& /*link*/) noexcept {}

 private:
  PlantSession& session_;
  const PlantRunSettings& settings_;
  std::optional<RunColumns> columns_;
};

}  // namespace

const char* to_string(PlantRunEnd end) noexcept {
  switch (end) {
    case PlantRunEnd::kCompleted:
      return "completed";
    case PlantRunEnd::kStopped:
      return "stopped";
    case PlantRunEnd::kControllerEnded:
      return "controller ended";
    case PlantRunEnd::kStartRefused:
      return "start refused by the controller";
    case PlantRunEnd::kControllerSilent:
      return "controller silent";
    case PlantRunEnd::kCommandsRefused:
      return "commands refused";
    case PlantRunEnd::kControllerNeverHeard:
      return "controller never heard";
    case PlantRunEnd::kSecondPlant:
      return "second plant on this session";
    case PlantRunEnd::kSecondController:
      return "second controller on this session";
    case PlantRunEnd::kRefused:
      return "refused";
  }
  return "unknown";
}

JointArray viscous_brake(const Scenario& scenario, double time_constant_s) {
  const std::unique_ptr<Plant> plant = scenario.make_plant();
  const Eigen::VectorXd state = plant->initial_state(scenario.initial_angle, scenario.initial_speed);
  const JointArray mobility = plant->mobility(0.0, state);
  JointArray brake{};
  for (std::size_t j = 0; j < static_cast<std::size_t>(plant->joints()); ++j) {
    brake[j] = 1.0 / (time_constant_s * mobility[j]);
  }
  return brake;
}

PlantRunReport run_plant(PlantSession& session, Link& link, const PlantRunSettings& settings, Record* record,
                         const std::atomic<bool>& stop) {
  RobotSide side(session, settings, record);
  return PlantRun(side, link, settings, stop).run();
}

}  // namespace quasilpv
