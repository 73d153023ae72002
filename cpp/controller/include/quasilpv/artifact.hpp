// The controller as data: an immutable, validated artifact (docs/reference/formats.md).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "quasilpv/block_polytope.hpp"
#include "quasilpv/limiter.hpp"
#include "quasilpv/program.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// What every law knows of the robot: z(y), M_n(z) in kg m^2, G(y) in N m.
struct DesignModel {
  Program premises;
  BlockPolytope inertia;
  Program gravity;
};

/// A proved lower bound of the Lyapunov function of a moving robot (docs/concepts/motion.md), rad^2: the trace of
/// `joints` Z' `signals` Z. The rows of Z, one column per joint, are what is known of the loop, all in rad: the angle
/// error y - r, the innovation, T (w - r'), T^2 (d - d_f) and e_I / T.
struct LyapunovBound {
  static constexpr int kSignals = 5;
  Eigen::Matrix<double, kSignals, kSignals> signals;     ///< symmetric positive definite
  Eigen::Matrix<double, kMaxJoints, kMaxJoints> joints;  ///< the same; zero from the number of joints on
};

/// Kind `dob-acceleration`: scalars of the sampled law, the same for every joint. Errors are x - x_r: stabilising kp,
/// kd and ki are negative.
struct DobAccelerationParameters {
  DesignModel model;
  double kp = 0.0;                                             ///< 1/s^2
  double kd = 0.0;                                             ///< 1/s
  double ki = 0.0;                                             ///< 1/s^3
  std::array<double, 4> observer{};                            ///< l1 (1), l2 (1/s), l3 (1/s^2), l4 (1/s^3)
  double filter_time_constant_s = 0.0;                         ///< of the disturbance filter, > 0
  bool disturbance_compensation = true;                        ///< false: observed and predicted, but not subtracted
  std::optional<LyapunovBound> lyapunov_bound = std::nullopt;  ///< none: not designed for one
};

/// Kind `dob-torque`: gains scheduled on the premises of the inertia. Errors are x - x_r. With a premultiplication beta
/// gains and disturbances belong to beta(z) times the equations of motion: a torque x there is beta(z)^-1 x at the
/// joints.
struct DobTorqueParameters {
  DesignModel model;
  BlockPolytope feedback;                          ///< [Kp Kd KI], n x 3n: N m/rad, N m s/rad, N m/(rad s)
  BlockPolytope observer;                          ///< [L1; L2; L3; L4], 4n x n: 1/s, 1/s^2, N m/(rad s), N m/(rad s^2)
  double filter_time_constant_s = 0.0;             ///< of the disturbance filter, > 0
  std::optional<BlockPolytope> premultiplication;  ///< beta, n x n; none: the identity
};

/// Kind `hinf-tracking`: the gain Y(z) E(z)^-T P^-1 with E = diag(I, M_n, I), acting on (y - r, w - r', int (y - r)).
struct HinfTrackingParameters {
  DesignModel model;
  BlockPolytope numerator;                       ///< Y, n x 3n
  Eigen::MatrixXd lyapunov;                      ///< P, 3n x 3n, symmetric positive definite
  double velocity_filter_time_constant_s = 0.0;  ///< 0: no filter
};

/// Kind `state-feedback`: u = K(z) x with x = (y - r, w - r').
struct StateFeedbackParameters {
  DesignModel model;
  Program schedule;                              ///< premises of the gain, from angles and speeds
  BlockPolytope gain;                            ///< K, n x 2n: N m/rad, N m s/rad
  double velocity_filter_time_constant_s = 0.0;  ///< 0: no filter
};

/// Kind `descriptor-feedback`: u = F(z) E(z)^-T P^-1 x with E = diag(I, M_n) and x = (y - r, w - r').
struct DescriptorFeedbackParameters {
  DesignModel model;
  Program schedule;                              ///< premises of F, from angles and speeds
  BlockPolytope numerator;                       ///< F, n x 2n
  Eigen::MatrixXd lyapunov;                      ///< P, 2n x 2n, symmetric positive definite
  double velocity_filter_time_constant_s = 0.0;  ///< 0: no filter
};

inline constexpr int kMaxDelayedVertices = 16;
inline constexpr int kMinWindowSamples = 5;
inline constexpr int kMaxWindowSamples = 4096;

/// Kind `delayed-feedback`: u = F E(z)^-T P(varpi)^-1 x, F = sum_jkm w_j(z) varpi_k w_m(z_d) F_jkm, with varpi the mean
/// of the weights w over the last tau = N T seconds and z_d what z was tau ago; without E if `descriptor` is false.
struct DelayedFeedbackParameters {
  DesignModel model;
  Program schedule;                         ///< premises of P and F, from angles and speeds
  BlockPolytope lyapunov;                   ///< P, 2n x 2n, symmetric positive definite vertices; gives the weights
  std::vector<Eigen::MatrixXd> numerators;  ///< F_jkm, n x 2n, m fastest
  int window_samples = 0;                   ///< N; 0: the limit tau -> 0, varpi = w(z) and z_d = z
  bool descriptor = false;                  ///< false: without E(z)
  double velocity_filter_time_constant_s = 0.0;  ///< 0: no filter
};

/// Kind `pid`: gains in N m/rad, N m s/rad, N m/(rad s), acting on r - y.
struct PidParameters {
  DesignModel model;
  Program coriolis_reference;  ///< N(y, w) r'
  JointArray kp{};
  JointArray kd{};
  JointArray ki{};
  double velocity_filter_time_constant_s = 0.0;  ///< 0: no filter
};

/// Kinds `ctc` and `ctc-dob`: gains in 1/s^2, 1/s, 1/s^3, acting on r - y.
struct ComputedTorqueParameters {
  DesignModel model;
  Program coriolis;  ///< N(y, w) w
  JointArray gp{};
  JointArray gd{};
  JointArray gi{};
  double velocity_filter_time_constant_s = 0.0;       ///< 0: no filter
  double disturbance_observer_bandwidth_rad_s = 0.0;  ///< 0: kind `ctc`
};

using LawParameters =
    std::variant<DobAccelerationParameters, DobTorqueParameters, HinfTrackingParameters, StateFeedbackParameters,
                 DescriptorFeedbackParameters, DelayedFeedbackParameters, PidParameters, ComputedTorqueParameters>;

/// Interval of one joint.
struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// Operating domain the design was made for; entries from the number of joints on are unused.
struct OperatingDomain {
  std::array<Interval, kMaxJoints> angle_rad{};
  std::array<Interval, kMaxJoints> speed_rad_s{};

  /// Largest magnitude of the speeds of a joint, rad/s. RT-SAFE.
  double fastest(std::size_t joint) const noexcept {
    return std::max(std::abs(speed_rad_s[joint].low), std::abs(speed_rad_s[joint].high));
  }
};

/// A validated artifact. Immutable, self-contained: it keeps no reference to the bytes it came from.
class Artifact {
 public:
  /// Loads either twin. INIT-ONLY. Throws InputError: unreadable file, bytes that are not canonical, wrong hash,
  /// unknown or missing member, wrong type or size, unsound program, inertia that is not symmetric or not positive
  /// definite at the centre of its box.
  static Artifact load(const std::string& path);
  /// The same from bytes; `source` names them in errors. INIT-ONLY. Throws InputError.
  static Artifact parse(std::string_view bytes, const std::string& source);

  const std::string& name() const noexcept { return name_; }
  const std::string& hash() const noexcept { return hash_; }  ///< 64 lower-case hexadecimal digits
  /// First 8 bytes of the hash, big endian, as messages carry them. RT-SAFE.
  std::int64_t hash_prefix() const noexcept { return hash_prefix_; }
  const std::string& design_hash() const noexcept { return design_hash_; }
  const std::string& robot_id() const noexcept { return robot_id_; }
  const std::string& law_kind() const noexcept { return law_kind_; }
  double sample_period_s() const noexcept { return sample_period_s_; }
  int joints() const noexcept { return joints_; }
  const OperatingDomain& domain() const noexcept { return domain_; }
  const TorqueLimits& limits() const noexcept { return limits_; }
  const LawParameters& law() const noexcept { return law_; }

 private:
  void parse_header(const Field& root);
  void parse_limits(const Field& root);
  void parse_law(const Field& law, const Field& programs);

  std::string name_;
  std::string hash_;
  std::int64_t hash_prefix_ = 0;
  std::string design_hash_;
  std::string robot_id_;
  std::string law_kind_;
  double sample_period_s_ = 0.0;
  int joints_ = 0;
  OperatingDomain domain_;
  TorqueLimits limits_;
  LawParameters law_;
};

}  // namespace quasilpv
