// The control loop and the plant's side of it, sample by sample: what an executable does in real time, in virtual time.
#include <memory>

#include "bindings.hpp"
#include "quasilpv/artifact.hpp"
#include "quasilpv/loop.hpp"
#include "quasilpv/plant_session.hpp"
#include "quasilpv/realtime.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/trajectory.hpp"

namespace quasilpv::bindings {
namespace {

std::unique_ptr<ControlLoop> make_loop(const Artifact& artifact, const Trajectory& trajectory, bool bumpless_start) {
  LoopSettings settings;
  settings.bumpless_start = bumpless_start;
  return std::make_unique<ControlLoop>(artifact, trajectory, settings);
}

/// The clock of the fail-safe policy is that of lock-step, seq T.
void handle(ControlLoop& loop, std::int64_t seq, const DoubleArray& angle, const DoubleArray& speed,
            std::int64_t foreign_messages, const py::dict& gears) {
  RobotReading reading;
  reading.seq = seq;
  reading.angle_rad = to_joint_array(angle, loop.joints(), "angle");
  reading.speed_rad_s = to_joint_array(speed, loop.joints(), "speed");
  reading.gears = to_gear_reading(gears, loop.joints());
  SampleConditions conditions;
  conditions.consecutive_foreign = foreign_messages;
  conditions.now_ns = seq * to_nanoseconds(loop.sample_period_s());
  loop.handle(reading, conditions);
}

void bind_control_loop(py::module_& module) {
  py::class_<ControlLoop>(module, "ControlLoop", "One controller with its start, its policy and its limits.")
      .def(py::init(&make_loop), py::arg("artifact"), py::arg("trajectory"), py::arg("bumpless_start") = false)
      .def("handle", &handle, py::arg("seq"), py::arg("angle"), py::arg("speed"), py::arg("foreign_messages") = 0,
           py::arg("gears") = py::dict(), "Answer the reading of a sample newer than the last; the clock is seq T.")
      .def("reset_fault", &ControlLoop::reset_fault, "Leave a latched fault; whether that was possible.")
      .def_property_readonly(
          "torque", [](const ControlLoop& loop) { return to_numpy(loop.command().torque_nm, loop.joints()); },
          "N m, of the last command, shape (joints,).")
      .def_property_readonly("state", [](const ControlLoop& loop) { return to_string(loop.state()); })
      .def_property_readonly("cause", [](const ControlLoop& loop) { return to_string(loop.cause()); })
      .def_property_readonly(
          "flags", [](const ControlLoop& loop) { return loop.command().flags; }, "Fault bits of the last command.")
      .def_property_readonly("predicted_steps", &ControlLoop::predicted_steps)
      .def_property_readonly("faults", &ControlLoop::faults)
      .def_property_readonly(
          "refusal",
          [](const ControlLoop& loop) -> py::object {
            return loop.refusal() ? py::object(py::str(to_string(*loop.refusal()))) : py::object(py::none());
          },
          "Why there was no start, in one line; None if there was one.");
}

void bind_plant_session(py::module_& module) {
  py::class_<PlantSession>(module, "PlantSession", "The plant of a scenario, sample by sample, behind its sensors.")
      .def(py::init<const Scenario&, double>(), py::arg("scenario"), py::arg("sample_period_s"))
      .def_property_readonly("seq", &PlantSession::seq)
      .def_property_readonly("samples", &PlantSession::samples)
      .def(
          "measure",
          [](const PlantSession& session) {
            const Measurement& measured = session.measure(session.seq());
            return py::make_tuple(to_numpy(measured.angle, session.joints()),
                                  to_numpy(measured.speed, session.joints()));
          },
          "Measured (angle, speed) of the sample, each of shape (joints,).")
      .def_property_readonly(
          "gears",
          [](const PlantSession& session) { return to_dict(session.measure(session.seq()).gears, session.joints()); },
          "What the sensors of the gears measured, by name; empty for a robot without them.")
      .def_property_readonly(
          "angle", [](const PlantSession& session) { return to_numpy(session.truth().angle, session.joints()); })
      .def_property_readonly(
          "speed", [](const PlantSession& session) { return to_numpy(session.truth().speed, session.joints()); })
      .def(
          "advance",
          [](PlantSession& session, const DoubleArray& torque) {
            session.advance(session.seq(), to_joint_array(torque, session.joints(), "torque"));
          },
          py::arg("torque"), "Integrate over the sample under a torque (N m).");
}

}  // namespace

void bind_loop(py::module_& module) {
  bind_control_loop(module);
  bind_plant_session(module);
}

}  // namespace quasilpv::bindings
