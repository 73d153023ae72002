// The experiment: true plant, integrator, disturbance, sensors, delay, initial state. Format: docs/reference/formats.md
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "quasilpv/external_torque.hpp"
#include "quasilpv/integrator.hpp"
#include "quasilpv/plant.hpp"
#include "quasilpv/sensors.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// A scenario document, validated.
struct Scenario {
  std::string name;
  double duration_s = 0.0;
  PlantFactory plant;
  IntegratorOptions integrator;
  std::vector<SineTorque> external_torque;
  SensorOptions sensors;
  double transport_delay_s = 0.0;             ///< torque k acts from t_k + delay; at most one sample period
  std::optional<JointArray> torque_limit_nm;  ///< what the actuators deliver of any command, > 0; none: all of it
  JointArray initial_angle{};
  JointArray initial_speed{};

  /// Strict reading. INIT-ONLY. Throws InputError naming file, field, what was found and what was expected.
  static Scenario load(const std::string& path);
  static Scenario parse(std::string_view bytes, const std::string& source);

  int joints() const;

  /// The true plant at rest under no control torque, external torque attached. INIT-ONLY. Throws InputError.
  std::unique_ptr<Plant> make_plant() const;
};

}  // namespace quasilpv
