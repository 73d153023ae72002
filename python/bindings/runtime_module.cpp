// The Python extension quasilpv._runtime: its entry point, exceptions and conversions of joint arrays.
#include <algorithm>
#include <array>
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

namespace {

struct GearMember {
  const char* name;
  GearSensor sensor;
  JointArray GearReading::*values;
};
constexpr std::array<GearMember, 3> kGearMembers{{{"motor_angle_rad", kMotorAngle, &GearReading::motor_angle_rad},
                                                  {"link_angle_rad", kLinkAngle, &GearReading::link_angle_rad},
                                                  {"joint_torque_nm", kJointTorque, &GearReading::joint_torque_nm}}};

}  // namespace

GearReading to_gear_reading(const py::dict& gears, int joints) {
  GearReading reading;
  for (const auto& [key, value] : gears) {
    const auto name = key.cast<std::string>();
    const auto* const member = std::find_if(kGearMembers.begin(), kGearMembers.end(),
                                            [&](const GearMember& known) { return name == known.name; });
    if (member == kGearMembers.end()) {
      throw InputError("argument", "gears", name, "motor_angle_rad, link_angle_rad or joint_torque_nm");
    }
    reading.available |= member->sensor;
    reading.*(member->values) = to_joint_array(value.cast<DoubleArray>(), joints, member->name);
  }
  return reading;
}

py::dict to_dict(const GearReading& gears, int joints) {
  py::dict result;
  for (const GearMember& member : kGearMembers) {
    if (gears.has(member.sensor)) {
      result[member.name] = to_numpy(gears.*(member.values), joints);
    }
  }
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
