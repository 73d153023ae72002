// Which measurements can be true: what the operating domain says of the next one, and of the first.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "quasilpv/artifact.hpp"
#include "quasilpv/proved_limits.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// Why a controller does not start: a joint, its measured angle, and the interval it should be in, rad.
struct StartRefusal {
  int joint = 0;
  double angle_rad = 0.0;
  Interval expected;
  bool about_reference = false;  ///< the interval is around the reference, not the domain: the joint has none
};

/// "start refused: angle_rad[1]: got 7.2 rad, expected the operating domain, 0.96 to 2.044 rad". RT-UNSAFE.
std::string to_string(const StartRefusal& refusal);

/// Judges measurements by the artifact's operating domain. A speed counts as possible up to *twice* the largest of the
/// domain, w = 2 max |speed domain|.
///
/// * **Start**: every angle in its interval, and within the limits of the proof (ProvedLimits). A joint with an
/// interval of a whole turn or more has no domain in which
///   turns can be told apart: it starts within 1 rad of the reference.
/// * **Next**, n samples after the last accepted one: no joint moved by more than w T n, nor is it further than w T (1
/// +
///   m) from where its estimated speed carries it, m being how many of the samples between are missing. Samples that
///   were refused do not count in m: a lasting jump does not become possible by waiting. To both bounds comes what two
///   counts of a 12-bit encoder are, 3.1e-3 rad, so that coarse encoders at high rates pass. Nor is any angle further
///   outside its interval than half of its width (a joint with a domain).
/// * **Speed**: the measured ones, of laws that read them, and the estimated ones at most w.
class Plausibility {
 public:
  static constexpr double kSpeedFactor = 2.0;
  static constexpr double kLargestStartDistance = 1.0;
  static constexpr double kStepAllowance = 2.0 * 6.283185307179586 / 4096.0;

  /// INIT-ONLY.
  explicit Plausibility(const Artifact& artifact);

  /// Whether a controller may start at these measured angles; nothing: it may. RT-SAFE (bounded, no allocation, no
  /// lock, no throw), as all that follow. @param reference  angle of the reference at this sample, rad
  std::optional<StartRefusal> refuse_start(const JointArray& angle, const JointArray& reference) const noexcept;

  /// Whether the finite measurement of sample `seq` can follow the last accepted one; true if there is none.
  bool can_follow(std::int64_t seq, const JointArray& angle) const noexcept;

  /// Whether a law that reads speeds may use these; true for other laws, whatever they are.
  bool can_be_speed(const JointArray& speed) const noexcept;

  /// Whether one of the estimated speeds is beyond what the domain allows.
  bool is_beyond_domain(const JointArray& estimated_speed) const noexcept;

  bool has_accepted() const noexcept { return accepted_; }
  /// The measurement of sample `seq` counts.
  void accept(std::int64_t seq, const JointArray& angle) noexcept;
  /// A measurement came and does not count.
  void refuse() noexcept { ++refused_; }
  /// The speeds the law estimates at the sample accepted last.
  void estimate(const JointArray& speed) noexcept;

 private:
  bool has_domain(std::size_t joint) const noexcept;

  std::size_t joints_;
  double sample_period_s_;
  bool reads_speed_;
  OperatingDomain domain_;
  ProvedLimits proved_limits_;
  JointArray fastest_{};  // w, rad/s
  std::int64_t last_seq_ = 0;
  std::int64_t refused_ = 0;  // since the last accepted one
  JointArray last_angle_{};
  JointArray last_speed_{};
  bool accepted_ = false;
  bool speed_known_ = false;
};

}  // namespace quasilpv
