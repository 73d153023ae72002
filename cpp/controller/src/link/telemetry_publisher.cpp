#include "quasilpv/telemetry_publisher.hpp"

#include <chrono>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "quasilpv/realtime.hpp"

namespace quasilpv {

template <class Sample>
SamplePublisher<Sample>::SamplePublisher(std::unique_ptr<Link> link, double sample_period_s,
                                         SampleColumns<Sample> columns, std::unique_ptr<OutputFile> record)
    : link_(std::move(link)),
      sample_period_s_(sample_period_s),
      columns_(std::move(columns)),
      record_(std::move(record)),
      csv_(record_ != nullptr ? std::make_unique<CsvWriter>(record_->stream()) : nullptr),
      ring_(std::make_unique<Ring>()) {
  if (record_ != nullptr) {
    csv_->head("seq");
    csv_->head("time_s");
    columns_.head(*csv_);
    csv_->end_row();
  }
  thread_ = std::thread([this] { run(); });
}

template <class Sample>
SamplePublisher<Sample>::~SamplePublisher() {
  stop();
}

template <class Sample>
TelemetryReport SamplePublisher<Sample>::stop() {
  if (thread_.joinable()) {
    stopping_.store(true, std::memory_order_release);
    thread_.join();
    report_.drops = ring_->drops();
    report_.send_failures = link_ != nullptr ? link_->counters().send_failures : 0;
    if (rows_ > 0 && !record_->publish() && report_.record_drops == 0) {
      report_.record_drops = 1;  // the last rows were lost in the file's own buffer, or all with their place
    }
  }
  return report_;
}

template <class Sample>
void SamplePublisher<Sample>::run() {
  // The ring holds seconds of samples at 1 kHz: polling it leaves the control thread without a system call per sample.
  constexpr std::chrono::milliseconds kPollPeriod{1};
  leave_realtime();
  while (!stopping_.load(std::memory_order_acquire)) {
    drain();
    std::this_thread::sleep_for(kPollPeriod);
  }
  drain();
}

template <class Sample>
void SamplePublisher<Sample>::drain() {
  Sample sample;
  while (ring_->pop(sample)) {
    if (link_ != nullptr) {
      link_->send(sample);
      ++report_.published;
    }
    if (record_ != nullptr) {
      write_row(sample);
    }
  }
}

template <class Sample>
void SamplePublisher<Sample>::write_row(const Sample& sample) {
  csv_->add(sample.seq);
  csv_->add(static_cast<double>(sample.seq) * sample_period_s_);
  columns_.row(*csv_, sample);
  ++rows_;
  if (!csv_->end_row()) {
    ++report_.record_drops;
  }
}

template class SamplePublisher<TelemetrySample>;
template class SamplePublisher<SystemSample>;

namespace {

void add_robot_heads(CsvWriter& csv, int joints) {
  for (const char* name :
       {"measured_angle_rad", "measured_speed_rad_s", "reference_angle_rad", "reference_speed_rad_s",
        "reference_acceleration_rad_s2", "torque_commanded_nm", "torque_applied_nm", "estimated_angle_rad",
        "estimated_speed_rad_s", "estimated_disturbance", "filtered_disturbance", "integral_error_rad_s"}) {
    csv.head(name, joints);
  }
  for (const char* name : {"measured_motor_angle_rad", "measured_link_angle_rad", "measured_joint_torque_nm"}) {
    csv.head(name, joints);
  }
  for (const char* name : {"membership_sum", "premise_excess", "lyapunov_rad2", "flags", "state", "step_ns"}) {
    csv.head(name);
  }
}

template <class Sample>
void add_codes(CsvWriter& csv, const Sample& sample) {
  csv.add(static_cast<std::int64_t>(sample.flags));
  csv.add(static_cast<std::int64_t>(sample.state));
  csv.add(sample.step_ns);
}

void add_gears(CsvWriter& csv, const GearReading& gears, int joints) {
  JointArray none;
  none.fill(std::numeric_limits<double>::quiet_NaN());
  csv.add((gears.has(kMotorAngle) ? gears.motor_angle_rad : none).data(), joints);
  csv.add((gears.has(kLinkAngle) ? gears.link_angle_rad : none).data(), joints);
  csv.add((gears.has(kJointTorque) ? gears.joint_torque_nm : none).data(), joints);
}

void add_robot_row(CsvWriter& csv, const TelemetrySample& sample, int joints) {
  for (const JointArray* values :
       {&sample.measured_angle_rad, &sample.measured_speed_rad_s, &sample.reference_angle_rad,
        &sample.reference_speed_rad_s, &sample.reference_acceleration_rad_s2, &sample.commanded_torque_nm,
        &sample.applied_torque_nm, &sample.estimated_angle_rad, &sample.estimated_speed_rad_s,
        &sample.estimated_disturbance, &sample.filtered_disturbance, &sample.integral_error_rad_s}) {
    csv.add(values->data(), joints);
  }
  add_gears(csv, sample.gears, joints);
  for (const double value : {sample.membership_sum, sample.premise_excess, sample.lyapunov_rad2}) {
    csv.add(value);
  }
  add_codes(csv, sample);
}

std::vector<std::string> names_of(const std::vector<SystemSignal>& signals, const std::string& what) {
  std::vector<std::string> names;
  names.reserve(signals.size());
  for (const SystemSignal& signal : signals) {
    names.push_back(what + "." + signal.name);
  }
  return names;
}

SampleColumns<SystemSample> system_columns(const SystemArtifact& artifact) {
  std::vector<std::string> heads = names_of(artifact.states(), "measured");
  for (const char* what : {"commanded", "applied"}) {
    for (std::string& name : names_of(artifact.inputs(), what)) {
      heads.push_back(std::move(name));
    }
  }
  const int states = static_cast<int>(artifact.states().size());
  const int inputs = static_cast<int>(artifact.inputs().size());
  const int premises = artifact.gain().premises();
  return {[heads, premises](CsvWriter& csv) {
            for (const std::string& name : heads) {
              csv.head(name);
            }
            csv.head("premise", premises);
            for (const char* name : {"level", "flags", "state", "step_ns"}) {
              csv.head(name);
            }
          },
          [states, inputs, premises](CsvWriter& csv, const SystemSample& sample) {
            csv.add(sample.measured.data(), states);
            csv.add(sample.commanded.data(), inputs);
            csv.add(sample.applied.data(), inputs);
            csv.add(sample.premise.data(), premises);
            csv.add(sample.level);
            add_codes(csv, sample);
          }};
}

}  // namespace

TelemetryPublisher::TelemetryPublisher(std::unique_ptr<Link> link, double sample_period_s, int joints,
                                       std::unique_ptr<OutputFile> record)
    : SamplePublisher(std::move(link), sample_period_s,
                      {[joints](CsvWriter& csv) { add_robot_heads(csv, joints); },
                       [joints](CsvWriter& csv, const TelemetrySample& sample) { add_robot_row(csv, sample, joints); }},
                      std::move(record)) {}

SystemPublisher::SystemPublisher(std::unique_ptr<Link> link, const SystemArtifact& artifact,
                                 std::unique_ptr<OutputFile> record)
    : SamplePublisher(std::move(link), artifact.sample_period_s(), system_columns(artifact), std::move(record)) {}

}  // namespace quasilpv
