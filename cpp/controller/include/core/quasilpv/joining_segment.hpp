// The way from where the arm is to where the reference is.
#pragma once

#include <cstdint>

#include "quasilpv/artifact.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// A start, or a restart in motion, away from the reference: the law is told r + delta instead of r, where delta is the
/// quintic per joint that begins at the offset of the arm, (e, v, 0), and ends at (0, 0, 0) after D seconds. So the law
/// begins without an error, nothing jumps, and its torque is the one it would begin with on the reference.
///
/// D is the same for all joints and the shortest with, in every joint j,
///
///     |delta'|  <= 1.875 |e| / D + |v|,          1.875 |e_j| / D     <= a quarter of the domain's speed
///     |delta''| <= 5.774 |e| / D^2 + 3.94 |v| / D,  5.774 |e_j| / D^2 <= a / 5,  3.94 |v_j| / D <= 3 a / 10
///
/// and at least 20 ms; a is the acceleration that all torque limits allow if the joints had it at once, whatever the
/// posture: (torque limit of joint i) / max over vertices of sum_j |M_ij|, least of all i.
class JoiningSegment {
 public:
  /// INIT-ONLY. Over until begin().
  explicit JoiningSegment(const Artifact& artifact);

  /// Joins from sample `seq` on. RT-SAFE (bounded, no allocation, no lock, no throw), as all that follow.
  /// @param offset  rad, measured angle minus reference
  /// @param offset_speed  rad/s, the same of the speeds
  void begin(std::int64_t seq, const JointArray& offset, const JointArray& offset_speed) noexcept;

  /// Forgets the segment.
  void end() noexcept { duration_s_ = 0.0; }

  /// Whether the segment is not over at sample `seq`.
  bool is_joining(std::int64_t seq) const noexcept;

  /// delta, delta' and delta'' at sample `seq`.
  Reference offset(std::int64_t seq) const noexcept;

  double duration_s() const noexcept { return duration_s_; }

 private:
  double shortest(double offset, double speed, double fastest) const noexcept;

  std::size_t joints_;
  double sample_period_s_;
  double acceleration_;   // a, rad/s^2
  JointArray fastest_{};  // of the domain, rad/s
  std::int64_t first_seq_ = 0;
  double duration_s_ = 0.0;
  JointArray offset_{};
  JointArray speed_{};
};

}  // namespace quasilpv
