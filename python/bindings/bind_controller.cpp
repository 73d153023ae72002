// Artifact, its design model, the controller and the reference trajectory.
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "bindings.hpp"
#include "quasilpv/artifact.hpp"
#include "quasilpv/controller.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/trajectory.hpp"

namespace quasilpv::bindings {
namespace {

py::array_t<double> evaluate_angles(const Program& program, const Artifact& artifact, const DoubleArray& angle) {
  const JointArray angles = to_joint_array(angle, artifact.joints(), "angle");
  ProgramInput input;
  input.angle = angles.data();
  py::array_t<double> outputs(program.outputs());
  program.evaluate(input, outputs.mutable_data());
  return outputs;
}

/// N(y, w) w or N(y, w) r', whichever the law has.
py::array_t<double> evaluate_coriolis(const Artifact& artifact, const DoubleArray& angle, const DoubleArray& speed,
                                      const DoubleArray& reference_speed) {
  const int n = artifact.joints();
  const JointArray angles = to_joint_array(angle, n, "angle");
  const JointArray speeds = to_joint_array(speed, n, "speed");
  const JointArray reference_speeds = to_joint_array(reference_speed, n, "reference_speed");
  const ProgramInput input{angles.data(), speeds.data(), reference_speeds.data()};
  const Program* const coriolis = artifact.law().coriolis();
  if (coriolis == nullptr) {
    throw InputError("artifact", "law.kind", artifact.law_kind(), "a law with a Coriolis program");
  }
  JointArray torque{};
  coriolis->evaluate(input, torque.data());
  return to_numpy(torque, n);
}

template <int N>
py::array_t<double> inertia_of_size(const BlockPolytope& inertia, double* premise) {
  Eigen::Matrix<double, N, N> value;
  inertia.evaluate(premise, value);
  py::array_t<double> result({N, N});
  auto entries = result.mutable_unchecked<2>();
  for (int row = 0; row < N; ++row) {
    for (int column = 0; column < N; ++column) {
      entries(row, column) = value(row, column);
    }
  }
  return result;
}

template <std::size_t... Index>
py::array_t<double> inertia_dispatch(const BlockPolytope& inertia, int joints, double* premise,
                                     std::index_sequence<Index...> /*sizes*/) {
  using Function = py::array_t<double> (*)(const BlockPolytope&, double*);
  constexpr std::array<Function, sizeof...(Index)> kBySize{&inertia_of_size<static_cast<int>(Index) + 1>...};
  return kBySize[static_cast<std::size_t>(joints) - 1](inertia, premise);
}

/// M_n(z), z clamped to its box.
py::array_t<double> evaluate_inertia(const Artifact& artifact, const DoubleArray& premise) {
  const BlockPolytope& inertia = artifact.law().model.inertia;
  if (premise.ndim() != 1 || premise.shape(0) != inertia.premises()) {
    throw InputError("argument", "premise", "shape " + std::string(py::str(premise.attr("shape"))),
                     "shape (" + std::to_string(inertia.premises()) + ",)");
  }
  std::array<double, kMaxPremises> clamped{};
  std::copy_n(premise.data(), static_cast<std::size_t>(inertia.premises()), clamped.begin());
  return inertia_dispatch(inertia, artifact.joints(), clamped.data(), std::make_index_sequence<kMaxJoints>());
}

/// As the loop does: the law gets the angles of its side.
StepReport step(Controller& controller, const DoubleArray& angle, const DoubleArray& reference_angle,
                const DoubleArray& reference_speed, const DoubleArray& reference_acceleration, const DoubleArray& speed,
                std::int64_t seq, bool valid, const py::dict& gears) {
  const int n = controller.joints();
  StepInput input;
  input.seq = seq;
  input.valid = valid;
  input.angle = to_joint_array(angle, n, "angle");
  input.speed = to_joint_array(speed, n, "speed");
  input.reference.angle = to_joint_array(reference_angle, n, "reference_angle");
  input.reference.speed = to_joint_array(reference_speed, n, "reference_speed");
  input.reference.acceleration = to_joint_array(reference_acceleration, n, "reference_acceleration");
  input.gears = to_gear_reading(gears, n);
  controller.choose_angle(input);
  return controller.step(input);
}

template <typename Member>
auto joint_values(Member member) {
  return [member](const StepReport& report) { return to_numpy(report.*member, kMaxJoints); };
}

void bind_artifact(py::module_& module) {
  py::class_<Artifact>(module, "Artifact", "A validated controller as data. Immutable.")
      .def_static("load", &Artifact::load, py::arg("path"), "Load either twin from a file.")
      .def_static(
          "parse",
          [](const py::bytes& data, const std::string& source) {
            return Artifact::parse(static_cast<std::string_view>(data), source);
          },
          py::arg("data"), py::arg("source") = "artifact", "Load either twin from bytes.")
      .def_property_readonly("name", &Artifact::name)
      .def_property_readonly("hash", &Artifact::hash)
      .def_property_readonly("robot_id", &Artifact::robot_id)
      .def_property_readonly("law_kind", &Artifact::law_kind)
      .def_property_readonly("sample_period_s", &Artifact::sample_period_s)
      .def_property_readonly("joints", &Artifact::joints)
      .def(
          "premises",
          [](const Artifact& artifact, const DoubleArray& angle) {
            return evaluate_angles(artifact.law().model.premises, artifact, angle);
          },
          py::arg("angle"), "z(y), not clamped, shape (premises,).")
      .def(
          "gravity",
          [](const Artifact& artifact, const DoubleArray& angle) {
            const JointArray at = to_joint_array(angle, artifact.joints(), "angle");
            JointArray torque{};
            artifact.law().model.gravity_at(at.data(), torque.data());
            return to_numpy(torque, artifact.joints());
          },
          py::arg("angle"), "G(y), N m, shape (joints,).")
      .def("coriolis", &evaluate_coriolis, py::arg("angle"), py::arg("speed"), py::arg("reference_speed"),
           "The Coriolis torque that the law feeds forward, N(y, w) r' or N(y, w) w, N m, shape (joints,).")
      .def("inertia", &evaluate_inertia, py::arg("premise"), "M_n(z), kg m^2, shape (joints, joints); z is clamped.");
}

void bind_step(py::module_& module) {
  py::class_<StepReport>(module, "StepReport", "What one step computed; arrays have shape (7,), zero past the joints.")
      .def_readonly("seq", &StepReport::seq)
      .def_readonly("flags", &StepReport::flags, "Fault bits, 0 is healthy.")
      .def_property_readonly("torque_commanded", joint_values(&StepReport::torque_commanded))
      .def_property_readonly("torque_applied", joint_values(&StepReport::torque_applied))
      .def_property_readonly("estimated_angle", joint_values(&StepReport::estimated_angle))
      .def_property_readonly("estimated_speed", joint_values(&StepReport::estimated_speed))
      .def_property_readonly("estimated_disturbance", joint_values(&StepReport::estimated_disturbance))
      .def_property_readonly("filtered_disturbance", joint_values(&StepReport::filtered_disturbance))
      .def_property_readonly("integral_error", joint_values(&StepReport::integral_error));

  py::class_<Controller>(module, "Controller", "Law, state and workspace of one artifact.")
      .def(py::init<const Artifact&>(), py::arg("artifact"))
      .def("step", &step, py::arg("angle"), py::arg("reference_angle"), py::arg("reference_speed"),
           py::arg("reference_acceleration"), py::arg("speed"), py::arg("seq") = 0, py::arg("valid") = true,
           py::arg("gears") = py::dict(),
           "One sample; arrays of shape (joints,). gears: what is measured of joints that give, by name.")
      .def("reset", &Controller::reset, "Forget all state.")
      .def_property_readonly("joints", &Controller::joints)
      .def_property_readonly("sample_period_s", &Controller::sample_period_s);
}

void bind_trajectory(py::module_& module) {
  py::class_<Trajectory>(module, "Trajectory", "Reference r(t), r'(t), r''(t): piecewise quintics in joint space.")
      .def_static("load", &Trajectory::load, py::arg("path"), "Load either twin from a file.")
      .def_static(
          "parse",
          [](const py::bytes& data, const std::string& source) {
            return Trajectory::parse(static_cast<std::string_view>(data), source);
          },
          py::arg("data"), py::arg("source") = "trajectory", "Load either twin from bytes.")
      .def(
          "evaluate",
          [](const Trajectory& trajectory, double time_s) {
            const Reference reference = trajectory.evaluate(time_s);
            const int n = trajectory.joints();
            return py::make_tuple(to_numpy(reference.angle, n), to_numpy(reference.speed, n),
                                  to_numpy(reference.acceleration, n));
          },
          py::arg("time_s"), "(r, r', r'') at a time, each of shape (joints,).")
      .def_property_readonly("name", &Trajectory::name)
      .def_property_readonly("hash", &Trajectory::hash)
      .def_property_readonly("joints", &Trajectory::joints)
      .def_property_readonly("duration_s", &Trajectory::duration_s);
}

}  // namespace

void bind_controller(py::module_& module) {
  bind_artifact(module);
  bind_step(module);
  bind_trajectory(module);
}

}  // namespace quasilpv::bindings
