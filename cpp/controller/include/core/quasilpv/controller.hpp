// The controller as the loop sees it: an artifact bound to its law, one step at a time.
#pragma once

#include <memory>

#include "quasilpv/artifact.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

class ControlLaw;

/// Owns law, state and workspace of one artifact. Construction allocates; nothing after it does.
class Controller {
 public:
  /// Dispatches once on the law kind and the number of joints. INIT-ONLY. Throws InputError.
  explicit Controller(const Artifact& artifact);
  ~Controller();
  Controller(Controller&&) noexcept;
  Controller& operator=(Controller&&) noexcept;

  /// Puts the angles that the law controls, those of its side, in the place of `input.angle`, and leaves out sensors
  /// of gears that failed. Without an encoder on that side the input is not valid. To be done before step(). RT-SAFE
  /// (bounded, no allocation, no lock, no throw).
  void choose_angle(StepInput& input) const noexcept;

  /// One sample, in the order of the law's own documentation. RT-SAFE (bounded, no allocation, no lock, no throw).
  StepReport step(const StepInput& input) noexcept;

  /// Forgets all state; the next step starts the observer at the measurement. RT-SAFE.
  void reset() noexcept;

  /// Forgets all state, for a robot that moves already: see ControlLaw::take_over(). RT-SAFE.
  void take_over(const JointArray& in_force, const JointArray& speed) noexcept;

  int joints() const noexcept;
  double sample_period_s() const noexcept;

 private:
  std::unique_ptr<ControlLaw> law_;
  double sample_period_s_;
  int joints_;
  AngleSide side_;
};

}  // namespace quasilpv
