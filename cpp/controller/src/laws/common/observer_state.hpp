// State of a law with a disturbance observer, in whatever coordinates the disturbance is.
#pragma once

#include "laws/common/law_support.hpp"

namespace quasilpv {

/// x_hat = [angle, speed, disturbance, its rate], the filtered disturbance and the integral of the error.
template <int N>
struct ObserverState {
  JointVector<N> angle;
  JointVector<N> speed;
  JointVector<N> disturbance;
  JointVector<N> disturbance_rate;
  JointVector<N> filtered_disturbance;
  JointVector<N> integral_error;

  static ObserverState at(const JointVector<N>& angle, const JointVector<N>& speed,
                          const JointVector<N>& disturbance) noexcept {
    const JointVector<N> zero = JointVector<N>::Zero();
    return {angle, speed, disturbance, zero, zero, zero};
  }

  /// d_f = q d_f + (1 - q) d of these joints; of others it stays.
  void filter(double pole, const JointMask<N>& joints) noexcept {
    filtered_disturbance =
        joints.select(pole * filtered_disturbance + (1.0 - pole) * disturbance, filtered_disturbance);
  }

  /// Exact zero-order hold over t of th' = w, w' = a, a' = j, d' = d_rate:
  /// th += t w + t^2/2 a + t^3/6 j;  w += t a + t^2/2 j;  d += t d_rate.
  void advance(double t, const JointVector<N>& acceleration, const JointVector<N>& jerk) noexcept {
    angle += t * speed + t * t / 2.0 * acceleration + t * t * t / 6.0 * jerk;
    speed += t * acceleration + t * t / 2.0 * jerk;
    disturbance += t * disturbance_rate;
  }

  bool is_finite() const noexcept {
    return angle.allFinite() && speed.allFinite() && disturbance.allFinite() && disturbance_rate.allFinite() &&
           filtered_disturbance.allFinite() && integral_error.allFinite();
  }

  void write_to(StepReport& report) const noexcept {
    to_array<N>(angle, report.estimated_angle);
    to_array<N>(speed, report.estimated_speed);
    to_array<N>(disturbance, report.estimated_disturbance);
    to_array<N>(filtered_disturbance, report.filtered_disturbance);
    to_array<N>(integral_error, report.integral_error);
  }
};

}  // namespace quasilpv
