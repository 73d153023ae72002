// What the laws that read measured angles and speeds share: one sample, around the feedback that tells them apart.
#pragma once

#include "laws/common/law_support.hpp"

namespace quasilpv {

/// Parameters of a law that reads measured speeds.
struct VelocityParameters : LawParameters {
  double velocity_filter_time_constant_s = 0.0;  ///< 0: no filter
  JointArray dead_zone{};                        ///< at rest errors up to this are not integrated, rad; 0: all are

  bool reads_speed() const noexcept final { return true; }
};

/// One sample of a law with feedback from angles, speeds and the integral of the error, e = r - y. Without a valid
/// measurement the last one is held and the integral is frozen; anti-windup: see integrate_error(); at rest: see
/// moving_or_outside().
template <int N>
class VelocityLaw : public ControlLaw {
 public:
  StepReport step(const StepInput& input) noexcept final;

  void reset() noexcept final {
    measurement_.reset();
    limiter_.reset();
  }

  void take_over(const JointArray& in_force, const JointArray& speed) noexcept final {
    reset();
    measurement_.begin_at(from_array<N>(speed));
    limiter_.take_over(in_force);
  }

 protected:
  /// What one sample knows: reference, y, the filtered speed w, and the integral of r - y.
  struct Sample {
    ReferenceVectors<N> reference;
    JointVector<N> angle;
    JointVector<N> speed;
    JointVector<N> integral;
  };

  VelocityLaw(const VelocityParameters& parameters, const LawSettings& settings)
      : model_(parameters.model),
        sample_period_s_(settings.sample_period_s),
        dead_zone_(from_array<N>(parameters.dead_zone)),
        limiter_(settings.limits, settings.sample_period_s, N),
        measurement_(settings.sample_period_s, parameters.velocity_filter_time_constant_s) {}

 private:
  /// The law starts with this sample, under the torque in force: zero if nobody has held the arm.
  virtual void start(const Sample& /*sample*/, const ModelSample<N>& /*model*/,
                     const JointVector<N>& /*in_force*/) noexcept {}
  /// Whether control() feeds the acceleration of the reference and gravity forward.
  virtual bool feeds_forward() const noexcept = 0;
  /// The torque of this sample, before limits.
  virtual Command<N> control(const Sample& sample, const ModelSample<N>& model, StepReport& report) noexcept = 0;
  /// The torque that acts is in the report.
  virtual void applied(const Sample& /*sample*/, const ModelSample<N>& /*model*/, StepReport& /*report*/) noexcept {}

  /// What holds the arm `offset` beside the path, for a law whose own torque is for the path: G(y) - G(y - offset). The
  /// inertia of the offset is not fed forward: a law that lives from feedback alone is slow, so that on a plant much
  /// lighter than its model nobody would take back what that is too much.
  JointVector<N> holding_torque(const Reference& offset, const JointVector<N>& y,
                                const ModelSample<N>& model) noexcept {
    const JointVector<N> on_path = y - from_array<N>(offset.angle);
    JointVector<N> gravity;
    model_.gravity_at(on_path.data(), gravity.data());
    return model.gravity_torque() - gravity;
  }

  DesignModel model_;
  double sample_period_s_;
  JointVector<N> dead_zone_;
  Limiter limiter_;
  MeasurementFilter<N> measurement_;
  ReferenceGuard<N> reference_;
  JointVector<N> integral_ = JointVector<N>::Zero();
};

QUASILPV_OF_EVERY_SIZE(extern template class, VelocityLaw)

}  // namespace quasilpv
