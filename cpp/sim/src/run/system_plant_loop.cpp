// run_plant() of general systems.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "quasilpv/decimal.hpp"
#include "run/plant_run.hpp"

namespace quasilpv {
namespace {

class SystemColumns {
 public:
  SystemColumns(Record& record, const SystemSession& session)
      : record_(record), seq_(record.add_column("seq")), time_(record.add_column("time_s")) {
    for (const SystemSignal& state : session.artifact().states()) {
      states_.push_back(record.add_column("state." + state.name));
    }
    for (const SystemSignal& input : session.artifact().inputs()) {
      inputs_.push_back(record.add_column("input." + input.name));
    }
    delay_ = record.add_column("command_delay_s");
    record.reserve(static_cast<std::size_t>(session.samples()));
  }

  void append(const SystemSession& session, const InputArray& input, double delay_s) {
    record_.append(seq_, static_cast<double>(session.seq()));
    record_.append(time_, session.time_s());
    for (std::size_t k = 0; k < states_.size(); ++k) {
      record_.append(states_[k], session.truth()[k]);
    }
    for (std::size_t k = 0; k < inputs_.size(); ++k) {
      record_.append(inputs_[k], input[k]);
    }
    record_.append(delay_, delay_s);
  }

 private:
  Record& record_;
  std::size_t seq_, time_;
  std::vector<std::size_t> states_, inputs_;
  std::size_t delay_ = 0;
};

/// What PlantRun asks of a general system.
class SystemSide {
 public:
  using Command = signals_command_v1;
  using Values = InputArray;

  SystemSide(SystemSession& session, Record* record) : session_(session) {
    if (record != nullptr) {
      columns_.emplace(*record, session);
    }
    for (std::size_t k = 0; k < inputs().size(); ++k) {
      brake_[k] = inputs()[k].trim + std::clamp(0.0, inputs()[k].low, inputs()[k].high);
    }
  }

  double sample_period_s() const noexcept { return session_.sample_period_s(); }
  std::int64_t samples() const noexcept { return session_.samples(); }
  std::int64_t seq() const noexcept { return session_.seq(); }

  signals_measurement_v1 measurement() const noexcept {
    signals_measurement_v1 message{};
    message.seq = session_.seq();
    std::copy(session_.measured().begin(), session_.measured().end(), message.value);
    return message;
  }

  static InputArray values(const signals_command_v1& command) noexcept {
    InputArray input;
    std::copy(std::begin(command.input), std::end(command.input), input.begin());
    return input;
  }

  /// Trim and limit are added here as in the controller, so that an input at its limit is not beyond it.
  std::string refusal(const signals_command_v1& command) const {
    for (std::size_t k = 0; k < inputs().size(); ++k) {
      const SystemSignal& signal = inputs()[k];
      const double input = command.input[k];
      const double low = signal.trim + signal.low;
      const double high = signal.trim + signal.high;
      if (!std::isfinite(input) || input < low || input > high) {
        return "input " + signal.name + " of sample " + std::to_string(command.seq) + " is " + format_number(input) +
               ", outside " + format_number(low) + " to " + format_number(high);
      }
    }
    return "";
  }

  const InputArray& in_force() const noexcept { return session_.input(); }
  const InputArray& brake() const noexcept { return brake_; }

  void append(const InputArray& input, double delay_s) {
    if (columns_) {
      columns_->append(session_, input, delay_s);
    }
  }

  void advance(const InputArray& input) { session_.advance(input); }
  void advance(const InputArray& input, double delay_s) { session_.advance(input, delay_s); }

  void announce(Link& link) const noexcept {
    if (session_.exit()) {
      link.send(EventCode::kLeftDomain, session_.seq() - 1, session_.exit()->state);
    }
  }

 private:
  const std::vector<SystemSignal>& inputs() const noexcept { return session_.artifact().inputs(); }

  SystemSession& session_;
  std::optional<SystemColumns> columns_;
  InputArray brake_{};
};

}  // namespace

PlantRunReport run_plant(SystemSession& session, Link& link, const PlantRunSettings& settings, Record* record,
                         const std::atomic<bool>& stop) {
  SystemSide side(session, record);
  return PlantRun(side, link, settings, stop).run();
}

}  // namespace quasilpv
