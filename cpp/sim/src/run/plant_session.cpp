#include "quasilpv/plant_session.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

// The shortest interval worth integrating, s.
constexpr double kShortestInterval = 1e-9;

std::int64_t count_samples(const Scenario& scenario, double sample_period_s) {
  const std::string source = "scenario '" + scenario.name + "'";
  if (!std::isfinite(sample_period_s) || sample_period_s <= 10.0 * kShortestInterval) {
    throw InputError(source, "sample period", std::to_string(sample_period_s) + " s", "more than 10 ns");
  }
  if (scenario.transport_delay_s < 0.0 || scenario.transport_delay_s > sample_period_s) {
    throw InputError(source, "transport_delay_s", std::to_string(scenario.transport_delay_s),
                     "0 to the sample period, " + std::to_string(sample_period_s));
  }
  if (scenario.duration_s < sample_period_s) {
    throw InputError(source, "duration_s", std::to_string(scenario.duration_s),
                     "at least one sample of " + std::to_string(sample_period_s) + " s");
  }
  return std::llround(scenario.duration_s / sample_period_s);
}

}  // namespace

PlantSession::PlantSession(const Scenario& scenario, double sample_period_s, const IntegratorFactory& integrator)
    : plant_(scenario.make_plant()),
      sensors_(scenario.sensors, plant_->joints(), sample_period_s),
      sample_period_s_(sample_period_s),
      transport_delay_s_(scenario.transport_delay_s),
      torque_limit_nm_(scenario.torque_limit_nm),
      samples_(count_samples(scenario, sample_period_s)),
      state_(plant_->initial_state(scenario.initial_angle, scenario.initial_speed)) {
  integrator_ = integrator ? integrator(*plant_) : make_integrator(scenario.integrator, *plant_, sample_period_s);
  observe(0.0);
}

void PlantSession::expect_current(std::int64_t k) const {
  if (k != seq_) {
    throw InputError("plant session", "seq", std::to_string(k), std::to_string(seq_));
  }
}

// Truth and measurement at the end of an interval, under the torque that acted on it. What the torque sensors say is
// what drives hear over the next one.
void PlantSession::observe(double time_s) {
  truth_ = plant_->sample(time_s, state_);
  measurement_ = sensors_.measure(seq_, truth_);
  if (measurement_.gears.has(kJointTorque)) {
    JointArray error{};
    for (std::size_t j = 0; j < error.size(); ++j) {
      error[j] = measurement_.gears.joint_torque_nm[j] - truth_.motors->joint_torque[j];
    }
    plant_->set_torque_error(error);
  }
}

const Measurement& PlantSession::measure(std::int64_t k) const {
  expect_current(k);
  return measurement_;
}

JointArray PlantSession::delivered(JointArray torque) const noexcept {
  if (torque_limit_nm_) {
    for (std::size_t j = 0; j < torque.size(); ++j) {
      torque[j] = std::clamp(torque[j], -(*torque_limit_nm_)[j], (*torque_limit_nm_)[j]);
    }
  }
  return torque;
}

void PlantSession::advance(std::int64_t k, const JointArray& commanded, double delay_s) {
  expect_current(k);
  const JointArray torque = delivered(commanded);
  const double start = static_cast<double>(k) * sample_period_s_;
  const double end = static_cast<double>(k + 1) * sample_period_s_;
  const double jump = std::clamp(start + delay_s, start, end);
  const bool old_torque_acts = jump - start > kShortestInterval;
  const bool new_torque_acts = end - jump > kShortestInterval;
  if (!old_torque_acts) {
    plant_->set_torque(torque);
    integrator_->advance(start, end, state_);
  } else if (!new_torque_acts) {
    integrator_->advance(start, end, state_);
  } else {
    integrator_->advance(start, jump, state_);
    plant_->set_torque(torque);
    integrator_->advance(jump, end, state_);
  }
  ++seq_;
  observe(end);
  plant_->set_torque(torque);
}

}  // namespace quasilpv
