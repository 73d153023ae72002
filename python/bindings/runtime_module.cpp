// The Python extension quasilpv._runtime: its entry point, exceptions and conversions of joint arrays.
#include <algorithm>
#include <cstddef>
#include <exception>
#include <utility>

#include "bindings.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv::bindings {
namespace {

py::object python_error(const char* name) { return py::module_::import("quasilpv.errors").attr(name); }

/// Turns the exceptions of the C++ library into those of quasilpv.errors, with the same one-line message.
void translate(std::exception_ptr pointer) {
  try {
    std::rethrow_exception(std::move(pointer));
  } catch (const InputError& error) {
    const py::object type = python_error("InputError");
    py::set_error(type, type(error.source(), error.field(), error.got(), error.expected()));
  } catch (const PlantError& error) {
    py::set_error(python_error("PlantError"), error.what());
  } catch (const TransportError& error) {
    py::set_error(python_error("TransportError"), error.what());
  }
}

}  // namespace

JointArray to_joint_array(const DoubleArray& values, int joints, const char* name) {
  if (values.ndim() != 1 || values.shape(0) != joints) {
    throw InputError("argument", name, "shape " + std::string(py::str(values.attr("shape"))),
                     "shape (" + std::to_string(joints) + ",)");
  }
  JointArray result{};
  std::copy_n(values.data(), static_cast<std::size_t>(joints), result.begin());
  return result;
}

py::array_t<double> to_numpy(const JointArray& values, int joints) {
  return py::array_t<double>(static_cast<py::ssize_t>(joints), values.data());
}

}  // namespace quasilpv::bindings

PYBIND11_MODULE(_runtime, module) {
  namespace bindings = quasilpv::bindings;
  module.doc() = "The C++ runtime library: documents, controller, plant and closed loop.";
  pybind11::register_local_exception_translator(&bindings::translate);
  bindings::bind_documents(module);
  bindings::bind_controller(module);
  bindings::bind_simulation(module);
  bindings::bind_loop(module);
  bindings::bind_tree(module);
  bindings::bind_system(module);
}
