// What happens to a general system in one run: where it starts, what its parameters are, what its sensors tell.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "quasilpv/integrator.hpp"
#include "quasilpv/system_artifact.hpp"
#include "quasilpv/system_disturbance.hpp"

namespace quasilpv {

/// Imperfections of the sensors of the states, in their order; none if empty. A measured value is the multiple of its
/// `quantum` nearest to the value with noise; 0: exact.
struct SystemSensorOptions {
  std::vector<double> noise;    ///< standard deviations of white noise
  std::vector<double> quantum;  ///< of the signal with its trim
  std::uint64_t seed = 0;
};

/// One run. Values are those of the signals, trim included, in their order.
struct SystemScenario {
  std::string name;
  std::vector<double> start;      ///< of all states; algebraic ones are a first guess
  std::vector<double> parameter;  ///< of all parameters, true to the plant and told to the law where it knows them
  std::int64_t samples = 0;
  IntegratorOptions integrator = IdaOptions{};
  double delay_s = 0.0;  ///< until an input acts, at most one sample
  SystemSensorOptions sensors;
  std::vector<DisturbanceTerm> disturbances;
  /// Of the differential states, with which an observer begins in simulate_system(); none: as its artifact states.
  std::vector<double> estimate;

  /// Reads a `quasilpv.system_scenario` (docs/reference/formats.md), whose values are named as the signals of
  /// `artifact`. INIT-ONLY. Throws InputError.
  static SystemScenario load(const std::string& path, const SystemArtifact& artifact);
  /// The same from bytes; `source` names them in errors. INIT-ONLY. Throws InputError.
  static SystemScenario parse(std::string_view bytes, const std::string& source, const SystemArtifact& artifact);
};

}  // namespace quasilpv
