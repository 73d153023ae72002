// The controller as data: an immutable, validated artifact (docs/reference/formats.md).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "quasilpv/law_parameters.hpp"
#include "quasilpv/limiter.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

class Field;

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
  const LawParameters& law() const noexcept { return *law_; }

 private:
  void parse_header(const Field& root);
  void parse_limits(const Field& root);

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
  std::shared_ptr<const LawParameters> law_;  // shared by copies: it never changes
};

}  // namespace quasilpv
