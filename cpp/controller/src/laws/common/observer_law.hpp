// What the laws with a disturbance observer share: one sample, around the coordinates that tell them apart.
#pragma once

#include <cmath>

#include "laws/common/observer_state.hpp"

namespace quasilpv {

/// Parameters of a law with a disturbance observer.
struct ObserverParameters : LawParameters {
  double filter_time_constant_s = 0.0;  ///< of the disturbance filter, > 0

  bool reads_speed() const noexcept final { return false; }
};

/// One sample of a law that reads angles only and observes x_hat = [th, w, disturbance, its rate]. Starts at
/// x_hat = (y, w_0, d_0, 0), e_I = 0, with w_0 = 0 and d_0 = 0 unless take_over() knows better. Without a valid
/// measurement the innovation is zero, the prediction stands in for y, and e_I is frozen. A state that overflowed is
/// dropped: the law starts again at the next valid measurement.
///
/// d_0 is the last estimate of the disturbance from measurements that followed each other. Overruled, the law watches
/// under the torque in force, and d_0 is what it sees; once measurements fail it has lost sight and d_0 stays: what
/// was predicted without any is not believed. Zero at first, after reset() and after an overflow. So much of it is
/// taken back by the first torque, d_f = s d_0 with the largest s in [0, 1], as leaves no joint further from the torque
/// in force than the law without it would be, and four hundredths of its limit: whoever held the arm against a push up
/// to now does not let go, and a torque in force that knows nothing of the push is not left with a jump.
template <int N>
class ObserverLaw : public ControlLaw {
 public:
  StepReport step(const StepInput& input) noexcept final;

  void reset() noexcept final {
    started_ = false;
    lost_sight_ = false;
    first_speed_.setZero();
    first_disturbance_.setZero();
    limiter_.reset();
  }

  void take_over(const JointArray& in_force, const JointArray& speed) noexcept final {
    started_ = false;
    lost_sight_ = false;
    first_speed_ = from_array<N>(speed);
    limiter_.take_over(in_force);
  }

 protected:
  /// What is held over the period that follows.
  struct Motion {
    JointVector<N> acceleration;
    JointVector<N> jerk;
  };

  ObserverLaw(const ObserverParameters& parameters, const LawSettings& settings)
      : model_(parameters.model),
        sample_period_s_(settings.sample_period_s),
        filter_pole_(std::exp(-settings.sample_period_s / parameters.filter_time_constant_s)),
        limiter_(settings.limits, settings.sample_period_s, N),
        free_step_(kFreeStep * from_array<N>(settings.limits.torque_nm)) {}

 private:
  static constexpr double kFreeStep = 0.04;  // F11 asks for 0.05, of which rounding has some

  void start(const JointVector<N>& measured) noexcept {
    state_ = ObserverState<N>::at(measured, first_speed_, first_disturbance_);
    first_speed_.setZero();  // of this start only
    reference_.reset(measured);
    begin();
    started_ = true;
  }

  double share_at_once(const ModelSample<N>& model, const ReferenceVectors<N>& reference, StepReport& report) noexcept;

  /// What else is measured in this sample, before everything else.
  virtual void sense(const StepInput& /*input*/) noexcept {}
  /// Forgets what a law has beside the observer's state.
  virtual void begin() noexcept {}
  /// The reference of what is measured, from that of the joints: the same, unless a law knows what is between them.
  virtual ReferenceVectors<N> shape(const ReferenceVectors<N>& reference) noexcept { return reference; }
  /// Of which joints the filtered disturbance follows the estimate: all, unless a law has a rule of rest.
  virtual JointMask<N> compensated(const JointVector<N>& /*y*/, const ReferenceVectors<N>& /*reference*/) noexcept {
    return JointMask<N>::Constant(true);
  }
  /// Corrects the estimate by what was measured; the premises are in the report.
  virtual void correct(const JointVector<N>& measured, StepReport& report, ObserverState<N>& state) noexcept = 0;
  /// The torque of this sample, before limits; the premises are in the report.
  virtual Command<N> control(const ObserverState<N>& state, const ModelSample<N>& model,
                             const ReferenceVectors<N>& reference, StepReport& report) noexcept = 0;
  /// With the torque that acts on the plant, in the report, so that limits do not disturb the observer. If the model
  /// has no finite answer (gravity not finite, inertia not positive definite), kModelInvalid is set.
  virtual Motion predict(const ObserverState<N>& state, const ModelSample<N>& model,
                         const ReferenceVectors<N>& reference, StepReport& report) noexcept = 0;

  DesignModel model_;
  double sample_period_s_;
  double filter_pole_;
  Limiter limiter_;
  JointVector<N> free_step_;  // of the first torque, N m
  ReferenceGuard<N> reference_;
  ObserverState<N> state_;
  JointVector<N> first_speed_ = JointVector<N>::Zero();
  JointVector<N> first_disturbance_ = JointVector<N>::Zero();
  bool started_ = false;
  bool lost_sight_ = false;
};

QUASILPV_OF_EVERY_SIZE(extern template class, ObserverLaw)

}  // namespace quasilpv
