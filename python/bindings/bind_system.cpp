// General systems: artifact, controller and the closed loop in one process.
#include <pybind11/stl.h>

#include <algorithm>
#include <vector>

#include "bindings.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/system_simulation.hpp"

namespace quasilpv::bindings {
namespace {

std::vector<double> to_values(const DoubleArray& values, std::size_t size, const char* name) {
  if (values.ndim() != 1 || values.shape(0) != static_cast<py::ssize_t>(size)) {
    throw InputError("argument", name, "shape " + std::string(py::str(values.attr("shape"))),
                     "shape (" + std::to_string(size) + ",)");
  }
  return {values.data(), values.data() + size};
}

py::array_t<double> leading(const double* values, std::size_t count) {
  return py::array_t<double>(static_cast<py::ssize_t>(count), values);
}

py::dict step(SystemController& controller, const DoubleArray& state, const DoubleArray& parameter) {
  const SystemArtifact& artifact = controller.artifact();
  const std::vector<double> states = to_values(state, artifact.states().size(), "state");
  const std::vector<double> parameters = to_values(parameter, artifact.parameters().size(), "parameter");
  const SystemReport report = controller.step(states.data(), parameters.data());
  py::dict result;
  result["flags"] = report.flags;
  result["input"] = leading(report.input.data(), artifact.inputs().size());
  result["commanded"] = leading(report.commanded.data(), artifact.inputs().size());
  result["premise"] = leading(report.premise.data(), static_cast<std::size_t>(artifact.gain().premises()));
  result["state"] = leading(report.state.data(), artifact.states().size());
  result["level"] = report.level;
  return result;
}

py::array_t<double> column_to_numpy(const Record::Column& column) {
  const std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(column.samples()),
                                       static_cast<py::ssize_t>(column.width)};
  py::array_t<double> result(shape);
  std::copy(column.values.begin(), column.values.end(), result.mutable_data());
  return result;
}

py::dict simulate(const SystemArtifact& artifact, const SystemScenario& scenario) {
  SystemRun run;
  {
    const py::gil_scoped_release release;
    run = simulate_system(artifact, scenario);
  }
  py::dict columns;
  for (const Record::Column& column : run.samples.columns()) {
    columns[py::str(column.name)] = column_to_numpy(column);
  }
  py::dict result;
  result["columns"] = columns;
  result["flags"] = run.flags;
  if (run.exit) {
    result["exit"] =
        py::make_tuple(run.exit->time_s, artifact.states()[static_cast<std::size_t>(run.exit->state)].name);
  } else {
    result["exit"] = py::none();
  }
  return result;
}

}  // namespace

void bind_system(py::module_& module) {
  py::class_<SystemArtifact>(module, "SystemArtifact", "The controller of a general system, validated.")
      .def_static("load", &SystemArtifact::load, py::arg("path"), "Strict reading of either twin.")
      .def_static(
          "parse",
          [](const py::bytes& data, const std::string& source) {
            return SystemArtifact::parse(static_cast<std::string_view>(data), source);
          },
          py::arg("data"), py::arg("source") = "artifact", "Strict reading of bytes.")
      .def_property_readonly("name", &SystemArtifact::name)
      .def_property_readonly("hash", &SystemArtifact::hash);

  py::class_<SystemController>(module, "SystemController", "u = K(z) x_d, limited, one call per sample.")
      .def(py::init<SystemArtifact>(), py::arg("artifact"))
      .def(
          "reset", [](SystemController& controller) { controller.reset(); },
          "Forget the last input; estimates begin as the artifact states.")
      .def("step", &step, py::arg("state"), py::arg("parameter"),
           "One step: flags, input, commanded, premise, state as the law used it, level; signals with their trim.");

  py::class_<SystemScenario>(module, "SystemScenario", "What happens to a general system in one run.")
      .def_static(
          "parse",
          [](const py::bytes& data, const std::string& source, const SystemArtifact& artifact) {
            return SystemScenario::parse(static_cast<std::string_view>(data), source, artifact);
          },
          py::arg("data"), py::arg("source"), py::arg("artifact"), "Strict reading of JSON, for this artifact.")
      .def_readonly("name", &SystemScenario::name)
      .def_readwrite("estimate", &SystemScenario::estimate,
                     "Of the differential states, with which an observer begins; empty: as its artifact states.")
      .def_readonly("samples", &SystemScenario::samples);

  module.def(
      "disturbance_of",
      [](const SystemArtifact& artifact, const SystemScenario& scenario) {
        const std::vector<double> values = disturbance_of(artifact, scenario);
        const auto width = static_cast<py::ssize_t>(artifact.states().size() + artifact.inputs().size());
        const std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(scenario.samples), width};
        return py::array_t<double>(shape, values.data());
      },
      py::arg("artifact"), py::arg("scenario"),
      "What is added at every sample, (samples, states + inputs): to rates of states and to inputs.");

  module.def("simulate_system", &simulate, py::arg("artifact"), py::arg("scenario"),
             "The closed loop in lock-step: columns (samples, width), flags, and where a state left its domain. "
             "Releases the GIL.");
}

}  // namespace quasilpv::bindings
