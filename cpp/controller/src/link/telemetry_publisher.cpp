#include "quasilpv/telemetry_publisher.hpp"

#include <chrono>
#include <limits>
#include <utility>

#include "quasilpv/realtime.hpp"

namespace quasilpv {

TelemetryPublisher::TelemetryPublisher(std::unique_ptr<Link> link, double sample_period_s, int joints,
                                       std::unique_ptr<OutputFile> record)
    : link_(std::move(link)),
      sample_period_s_(sample_period_s),
      joints_(joints),
      record_(std::move(record)),
      csv_(record_ != nullptr ? std::make_unique<CsvWriter>(record_->stream()) : nullptr),
      ring_(std::make_unique<Ring>()) {
  if (record_ != nullptr) {
    write_header();
  }
  thread_ = std::thread([this] { run(); });
}

TelemetryPublisher::~TelemetryPublisher() { stop(); }

TelemetryReport TelemetryPublisher::stop() {
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

void TelemetryPublisher::run() {
  // The ring holds seconds of samples at 1 kHz: polling it leaves the control thread without a system call per sample.
  constexpr std::chrono::milliseconds kPollPeriod{1};
  leave_realtime();
  while (!stopping_.load(std::memory_order_acquire)) {
    drain();
    std::this_thread::sleep_for(kPollPeriod);
  }
  drain();
}

void TelemetryPublisher::drain() {
  TelemetrySample sample;
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

void TelemetryPublisher::write_header() {
  csv_->head("seq");
  csv_->head("time_s");
  for (const char* name :
       {"measured_angle_rad", "measured_speed_rad_s", "reference_angle_rad", "reference_speed_rad_s",
        "reference_acceleration_rad_s2", "torque_commanded_nm", "torque_applied_nm", "estimated_angle_rad",
        "estimated_speed_rad_s", "estimated_disturbance", "filtered_disturbance", "integral_error_rad_s"}) {
    csv_->head(name, joints_);
  }
  for (const char* name : {"measured_motor_angle_rad", "measured_link_angle_rad", "measured_joint_torque_nm"}) {
    csv_->head(name, joints_);
  }
  for (const char* name : {"membership_sum", "premise_excess", "lyapunov_rad2", "flags", "state", "step_ns"}) {
    csv_->head(name);
  }
  csv_->end_row();
}

void TelemetryPublisher::write_gears(const GearReading& gears) {
  JointArray none;
  none.fill(std::numeric_limits<double>::quiet_NaN());
  csv_->add((gears.has(kMotorAngle) ? gears.motor_angle_rad : none).data(), joints_);
  csv_->add((gears.has(kLinkAngle) ? gears.link_angle_rad : none).data(), joints_);
  csv_->add((gears.has(kJointTorque) ? gears.joint_torque_nm : none).data(), joints_);
}

void TelemetryPublisher::write_row(const TelemetrySample& sample) {
  csv_->add(sample.seq);
  csv_->add(static_cast<double>(sample.seq) * sample_period_s_);
  for (const JointArray* values :
       {&sample.measured_angle_rad, &sample.measured_speed_rad_s, &sample.reference_angle_rad,
        &sample.reference_speed_rad_s, &sample.reference_acceleration_rad_s2, &sample.commanded_torque_nm,
        &sample.applied_torque_nm, &sample.estimated_angle_rad, &sample.estimated_speed_rad_s,
        &sample.estimated_disturbance, &sample.filtered_disturbance, &sample.integral_error_rad_s}) {
    csv_->add(values->data(), joints_);
  }
  write_gears(sample.gears);
  for (const double value : {sample.membership_sum, sample.premise_excess, sample.lyapunov_rad2}) {
    csv_->add(value);
  }
  csv_->add(static_cast<std::int64_t>(sample.flags));
  csv_->add(static_cast<std::int64_t>(sample.state));
  csv_->add(sample.step_ns);
  ++rows_;
  if (!csv_->end_row()) {
    ++report_.record_drops;
  }
}

}  // namespace quasilpv
