// What acts on a general system besides its inputs: constants, steps, sines and noise on inputs and rates of states.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "quasilpv/sensors.hpp"

namespace quasilpv {

/// No edge of a disturbance and no jump of an input is nearer to the next one than this, s.
inline constexpr double kShortestInterval = 1e-9;

/// One term, which acts from `begin_s` until `end_s`. A constant with a beginning is a step.
struct DisturbanceTerm {
  enum class Kind { kConstant, kSine, kNoise };

  Kind kind = Kind::kConstant;
  std::size_t signal = 0;  ///< states first, then inputs: added to the rate of a state, or to an input
  double size = 0.0;  ///< value, amplitude or standard deviation, in the unit of the signal (of a state: per second)
  double frequency_rad_s = 0.0;
  double phase_rad = 0.0;
  double begin_s = 0.0;
  double end_s = std::numeric_limits<double>::infinity();
  std::uint64_t seed = 0;
};

/// The sum of terms as a function of plant time: sines are continuous, noise is held over a sample.
class SystemDisturbance {
 public:
  SystemDisturbance() = default;
  /// INIT-ONLY.
  explicit SystemDisturbance(const std::vector<DisturbanceTerm>& terms);

  /// Draws the noise of the next sample, in the order of the terms: once per sample.
  void draw();
  /// From `time_s` on those terms act that act right after it.
  void begin(double time_s) noexcept;
  /// Where the next term begins or ends between `from_s` and `to_s`; `to_s` if none does.
  double next_edge(double from_s, double to_s) const noexcept;
  /// Adds what acts at `time_s` to the values of states (their rates) and inputs. RT-SAFE (bounded, no allocation, no
  /// lock, no throw).
  void add(double time_s, double* signals) const noexcept;

 private:
  struct Source {
    DisturbanceTerm term;
    GaussianNoise noise;
    double held = 0.0;
    bool acts = false;
  };

  std::vector<Source> sources_;
};

}  // namespace quasilpv
