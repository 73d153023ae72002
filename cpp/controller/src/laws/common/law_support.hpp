// What the laws share: fixed-size vectors, the design model at one sample, the reference guard, the integral.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

#include "laws/common/small_solvers.hpp"
#include "quasilpv/law_parameters.hpp"

namespace quasilpv {

template <int N>
using JointVector = Eigen::Matrix<double, N, 1>;
template <int N>
using JointMatrix = Eigen::Matrix<double, N, N>;

template <int N>
JointVector<N> from_array(const JointArray& values) noexcept {
  return Eigen::Map<const JointVector<N>>(values.data());
}

template <int N>
void to_array(const JointVector<N>& values, JointArray& array) noexcept {
  std::copy(values.data(), values.data() + N, array.data());
}

/// M_n(z(y)) and G(y) at one sample; of a chain of bodies only the angles, and what is asked for is computed.
template <int N>
struct ModelSample {
  JointMatrix<N> inertia;
  JointVector<N> gravity;
  const TreeDynamics* tree = nullptr;
  JointVector<N> angle;

  /// M_n a + G, of a chain in one sweep.
  JointVector<N> torque(const JointVector<N>& a) const noexcept {
    if (tree == nullptr) {
      return inertia * a + gravity;
    }
    JointVector<N> result;
    tree->torque_at_rest(angle.data(), a.data(), result.data());
    return result;
  }

  /// M_n^-1 torque; NaN if M_n is not positive definite at this measurement.
  JointVector<N> acceleration(const JointVector<N>& torque) const noexcept {
    if (tree == nullptr) {
      return solve_positive_definite<N>(inertia, torque);
    }
    const JointMatrix<N> mass = tree->inertia(angle.data());
    return solve_positive_definite<N>(mass, torque);
  }

  /// G at this sample.
  JointVector<N> gravity_torque() const noexcept {
    if (tree == nullptr) {
      return gravity;
    }
    return torque(JointVector<N>::Zero());
  }
};

/// One answer per joint.
template <int N>
using JointMask = Eigen::Array<bool, N, 1>;

/// Which joints are farther from their reference than their dead zone, rad; a joint without one, 0, is always. What
/// integrates waits for the others: a joint that sticks is left alone where it is near enough.
template <int N>
JointMask<N> outside(const JointVector<N>& dead_zone, const JointVector<N>& error) noexcept {
  return error.array().abs() > dead_zone.array() || dead_zone.array() == 0.0;
}

/// The rule of rest: outside() of a reference that rests. One that takes less than this time to cross the dead zone
/// moves, and nothing waits for a joint that follows it.
template <int N>
JointMask<N> moving_or_outside(const JointVector<N>& dead_zone, const JointVector<N>& error,
                               const JointVector<N>& reference_speed) noexcept {
  constexpr double kRestS = 1.0;
  return outside<N>(dead_zone, error) || reference_speed.array().abs() * kRestS > dead_zone.array();
}

/// Evaluates the design model at the angles y; stores the clamped premises and their flag in the report.
template <int N>
ModelSample<N> sample_model(const DesignModel& model, const JointVector<N>& y, StepReport& report) noexcept {
  ModelSample<N> sample;
  if (model.tree) {
    sample.tree = model.tree.get();
    sample.angle = y;
    return sample;
  }
  const ProgramInput input{y.data()};
  model.premises.evaluate(input, report.premise.data());
  if (model.inertia.evaluate(report.premise.data(), sample.inertia)) {
    report.flags |= kPremiseOutsideBox;
  }
  model.gravity.evaluate(input, sample.gravity.data());
  return sample;
}

/// Reference of one sample, as vectors.
template <int N>
struct ReferenceVectors {
  JointVector<N> angle;
  JointVector<N> speed;
  JointVector<N> acceleration;

  bool is_finite() const noexcept { return angle.allFinite() && speed.allFinite() && acceleration.allFinite(); }
};

/// Lets finite references through; for any other the angles of the last finite one are held at rest.
template <int N>
class ReferenceGuard {
 public:
  /// Starts to hold `angle`.
  void reset(const JointVector<N>& angle) noexcept { held_ = angle; }

  ReferenceVectors<N> accept(const Reference& reference, StepReport& report) noexcept {
    ReferenceVectors<N> offered{from_array<N>(reference.angle), from_array<N>(reference.speed),
                                from_array<N>(reference.acceleration)};
    if (!offered.is_finite()) {
      report.flags |= kReferenceInvalid;
      return {held_, JointVector<N>::Zero(), JointVector<N>::Zero()};
    }
    held_ = offered.angle;
    return offered;
  }

 private:
  JointVector<N> held_ = JointVector<N>::Zero();
};

/// Angle and speed as the baselines use them: the speed low-pass filtered, w = a w + (1 - a) w_measured with
/// a = exp(-T/T_f), starting at the first measured speed, or before it at the one of begin_at(); both held while there
/// is no valid measurement.
template <int N>
class MeasurementFilter {
 public:
  /// T_f = 0: no filter.
  MeasurementFilter(double sample_period_s, double time_constant_s)
      : pole_(time_constant_s > 0.0 ? std::exp(-sample_period_s / time_constant_s) : 0.0) {}

  /// Takes one sample. \returns whether it was valid; if not, kMeasurementInvalid is set.
  bool accept(const StepInput& input, StepReport& report) noexcept {
    const JointVector<N> measured_angle = from_array<N>(input.angle);
    const JointVector<N> measured_speed = from_array<N>(input.speed);
    if (!input.valid || !measured_angle.allFinite() || !measured_speed.allFinite()) {
      report.flags |= kMeasurementInvalid;
      return false;
    }
    angle_ = measured_angle;
    const bool continues = started_ || begun_;
    speed_ = continues ? JointVector<N>(pole_ * speed_ + (1.0 - pole_) * measured_speed) : measured_speed;
    started_ = true;
    return true;
  }

  void reset() noexcept { started_ = begun_ = false; }

  /// The filter stood at this speed before the first measurement.
  void begin_at(const JointVector<N>& speed) noexcept {
    speed_ = speed;
    begun_ = true;
  }

  bool started() const noexcept { return started_; }
  const JointVector<N>& angle() const noexcept { return angle_; }
  const JointVector<N>& speed() const noexcept { return speed_; }

 private:
  double pole_;
  bool started_ = false;
  bool begun_ = false;
  JointVector<N> angle_ = JointVector<N>::Zero();
  JointVector<N> speed_ = JointVector<N>::Zero();
};

/// xi = (e, e', int e) and the gain [Kp Kd KI] that acts on it.
template <int N>
using TrackingError = Eigen::Matrix<double, 3 * N, 1>;
template <int N>
using TrackingGain = Eigen::Matrix<double, N, 3 * N>;

/// What a law wants of one sample: the torque before limits, N m, and the gains of its integrals, whose signs say which
/// way each integral pushes (see integrate_error()).
template <int N>
struct Command {
  JointVector<N> torque;
  JointVector<N> integral_gain;
};

/// The torque that acts, from the one commanded, into the report: what the limits leave of it, unless the law is
/// overruled. Returns the flags of the limiter.
inline std::uint32_t limit(Limiter& limiter, const StepInput& input, StepReport& report) noexcept {
  const std::uint32_t flags = limiter.apply(report.torque_commanded, input.commanded, report.torque_applied);
  if (input.overruled) {
    report.torque_applied = input.in_force;
  }
  return flags;
}

/// Forward Euler of the integral of the error, e_I += T e, of the joints that have integral action. Anti-windup by
/// clamping: joint j is frozen while its torque is limited and gain_j e_j pushes further in the direction that the
/// limits cut off, or while the torque is not finite.
template <int N>
void integrate_error(const JointVector<N>& error, const JointVector<N>& gain, const StepReport& report,
                     double sample_period_s, JointVector<N>& integral) noexcept {
  for (int j = 0; j < N; ++j) {
    const auto joint = static_cast<std::size_t>(j);
    const double cut_off = report.torque_commanded[joint] - report.torque_applied[joint];
    const bool winds_up = !(cut_off * gain[j] * error[j] <= 0.0);  // true for NaN
    if (!winds_up && gain[j] != 0.0) {
      integral[j] += sample_period_s * error[j];
    }
  }
}

/// What is the same in many laws is compiled once for every number of joints: `template class` stands in one .cpp file,
/// `extern template class` in the header.
#define QUASILPV_OF_EVERY_SIZE(instantiation, Law) \
  instantiation Law<1>;                            \
  instantiation Law<2>;                            \
  instantiation Law<3>;                            \
  instantiation Law<4>;                            \
  instantiation Law<5>;                            \
  instantiation Law<6>;                            \
  instantiation Law<7>;
static_assert(kMaxJoints == 7);

/// Law<n> for n = settings.joints in 1..kMaxJoints.
template <template <int> class Law, int N = 1, class Parameters>
std::unique_ptr<ControlLaw> make_law_of_size(const Parameters& parameters, const LawSettings& settings) {
  if (settings.joints == N) {
    return std::make_unique<Law<N>>(parameters, settings);
  }
  if constexpr (N < kMaxJoints) {
    return make_law_of_size<Law, N + 1>(parameters, settings);
  } else {
    throw std::invalid_argument("make_law: joints: got " + std::to_string(settings.joints) + ", expected 1 to 7");
  }
}

}  // namespace quasilpv
