// Plant, scenario and the closed loop in one process.
#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/scenario.hpp"
#include "quasilpv/serial_arm.hpp"
#include "quasilpv/simulation.hpp"
#include "quasilpv/trajectory.hpp"

namespace quasilpv::bindings {
namespace {

Eigen::VectorXd to_vector(const DoubleArray& values, int size, const char* name) {
  if (values.ndim() != 1 || values.shape(0) != size) {
    throw InputError("argument", name, "shape " + std::string(py::str(values.attr("shape"))),
                     "shape (" + std::to_string(size) + ",)");
  }
  return Eigen::Map<const Eigen::VectorXd>(values.data(), size);
}

py::array_t<double> to_numpy(const Eigen::VectorXd& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

/// The plant of a scenario with its external torque; torque and time are arguments, so that calls do not depend on each
/// other.
class BoundPlant {
 public:
  explicit BoundPlant(const Scenario& scenario) : plant_(scenario.make_plant()) {}

  int joints() const { return plant_->joints(); }
  int size() const { return plant_->size(); }

  py::array_t<double> residual(double time_s, const DoubleArray& state, const DoubleArray& derivative,
                               const DoubleArray& torque) {
    plant_->set_torque(to_joint_array(torque, joints(), "torque"));
    Eigen::VectorXd result(size());
    plant_->residual(time_s, to_vector(state, size(), "state"), to_vector(derivative, size(), "derivative"), result);
    return to_numpy(result);
  }

  py::array_t<double> derivative(double time_s, const DoubleArray& state, const DoubleArray& torque) {
    plant_->set_torque(to_joint_array(torque, joints(), "torque"));
    Eigen::VectorXd result(size());
    plant_->derivative(time_s, to_vector(state, size(), "state"), result);
    return to_numpy(result);
  }

  py::array_t<double> initial_state(const DoubleArray& angle, const DoubleArray& speed) const {
    return to_numpy(
        plant_->initial_state(to_joint_array(angle, joints(), "angle"), to_joint_array(speed, joints(), "speed")));
  }

  std::pair<py::array_t<double>, py::array_t<double>> make_consistent(double time_s, const DoubleArray& state,
                                                                      const DoubleArray& torque) {
    plant_->set_torque(to_joint_array(torque, joints(), "torque"));
    Eigen::VectorXd consistent = to_vector(state, size(), "state");
    Eigen::VectorXd derivative(size());
    plant_->make_consistent(time_s, consistent, derivative);
    return {to_numpy(consistent), to_numpy(derivative)};
  }

  py::array_t<double> mass_matrix(const DoubleArray& angle) const {
    const auto* arm = dynamic_cast<const SerialArm*>(plant_.get());
    if (arm == nullptr) {
      throw InputError("plant", "kind", "a plant without a mass matrix over its joints", "a serial arm");
    }
    const SerialArm::JointMatrix mass = arm->mass_matrix(to_vector(angle, joints(), "angle"));
    py::array_t<double> result({joints(), joints()});
    auto entries = result.mutable_unchecked<2>();
    for (int row = 0; row < joints(); ++row) {
      for (int column = 0; column < joints(); ++column) {
        entries(row, column) = mass(row, column);
      }
    }
    return result;
  }

 private:
  std::unique_ptr<Plant> plant_;
};

py::array_t<double> column_to_numpy(const Record::Column& column) {
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(column.samples())};
  if (column.width > 1) {
    shape.push_back(static_cast<py::ssize_t>(column.width));
  }
  py::array_t<double> result(shape);
  std::copy(column.values.begin(), column.values.end(), result.mutable_data());
  return result;
}

/// An integrator in Python: a function of (from_s, to_s, state, torque) that returns the state at to_s.
class PythonIntegrator : public Integrator {
 public:
  PythonIntegrator(const Plant& plant, const py::object& advance) : plant_(plant), advance_(advance) {}

  void advance(double from_s, double to_s, Eigen::VectorXd& y) override {
    const py::gil_scoped_acquire acquire;
    const py::object moved = advance_(from_s, to_s, to_numpy(y), bindings::to_numpy(plant_.torque(), plant_.joints()));
    y = to_vector(py::cast<DoubleArray>(moved), plant_.size(), "state");
  }

 private:
  const Plant& plant_;
  const py::object& advance_;  // of the call that runs the loop
};

py::dict run(const Artifact& artifact, const Trajectory& trajectory, const Scenario& scenario,
             const py::object& advance) {
  IntegratorFactory integrator;
  if (!advance.is_none()) {
    integrator = [&](const Plant& plant) { return std::make_unique<PythonIntegrator>(plant, advance); };
  }
  RunRecord record;
  {
    const py::gil_scoped_release release;
    record = run_closed_loop(scenario, artifact, trajectory, integrator);
  }
  py::dict columns;
  for (const Record::Column& column : record.samples.columns()) {
    columns[py::str(column.name)] = column_to_numpy(column);
  }
  return columns;
}

}  // namespace

void bind_simulation(py::module_& module) {
  py::class_<Scenario>(module, "Scenario", "The experiment: true plant, integrator, disturbance, sensors, delay.")
      .def_static("load", &Scenario::load, py::arg("path"), "Strict reading of a file.")
      .def_static(
          "parse",
          [](const py::bytes& data, const std::string& source) {
            return Scenario::parse(static_cast<std::string_view>(data), source);
          },
          py::arg("data"), py::arg("source") = "scenario", "Strict reading of JSON bytes.")
      .def_readonly("name", &Scenario::name)
      .def_readonly("duration_s", &Scenario::duration_s)
      .def_property_readonly("joints", &Scenario::joints);

  py::class_<BoundPlant>(module, "Plant", "The true plant of a scenario, its external torque attached.")
      .def(py::init<const Scenario&>(), py::arg("scenario"))
      .def_property_readonly("joints", &BoundPlant::joints)
      .def_property_readonly("size", &BoundPlant::size, "Components of the state.")
      .def("residual", &BoundPlant::residual, py::arg("time_s"), py::arg("state"), py::arg("derivative"),
           py::arg("torque"), "F(t, y, y') under a control torque (N m), shape (size,).")
      .def("derivative", &BoundPlant::derivative, py::arg("time_s"), py::arg("state"), py::arg("torque"),
           "Forward dynamics: y' of the differential components, 0 for multipliers, shape (size,).")
      .def("initial_state", &BoundPlant::initial_state, py::arg("angle"), py::arg("speed"),
           "y with the joints at these angles and speeds, shape (size,).")
      .def("make_consistent", &BoundPlant::make_consistent, py::arg("time_s"), py::arg("state"), py::arg("torque"),
           "(y, y') near a state that satisfy the equations and all constraints, multipliers included.")
      .def("mass_matrix", &BoundPlant::mass_matrix, py::arg("angle"), "M(theta), kg m^2, shape (joints, joints).");

  module.def("run_closed_loop", &run, py::arg("artifact"), py::arg("trajectory"), py::arg("scenario"),
             py::arg("advance") = py::none(),
             "The closed loop in lock-step: columns by name, shape (samples,) or (samples, joints). Releases the GIL. "
             "`advance(from_s, to_s, state, torque)` integrates the plant instead of the scenario's integrator.");
}

}  // namespace quasilpv::bindings
