// What the translation units of quasilpv._runtime share.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <nlohmann/json.hpp>
#include <string>

#include "document/document.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv::bindings {

namespace py = pybind11;

/// Any sequence of numbers, as a contiguous array of doubles.
using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

void bind_documents(py::module_& module);
void bind_controller(py::module_& module);
void bind_simulation(py::module_& module);
void bind_loop(py::module_& module);
void bind_tree(py::module_& module);
void bind_system(py::module_& module);

/// A Python tree (dict, list, tuple, str, bool, None, int, float) as a document. Throws InputError naming the type of
/// anything else.
Json to_json(const py::handle& value);

/// A document as a Python tree; an integral number below 2^53 in absolute value is an int, any other a float.
py::object to_python(const Json& value);

/// One value per joint from an array of shape [joints]. Throws InputError naming `name`, got and expected shape.
JointArray to_joint_array(const DoubleArray& values, int joints, const char* name);

/// What is measured of gears, from arrays of shape [joints] by name: motor_angle_rad, link_angle_rad, joint_torque_nm.
/// Throws InputError naming anything else.
GearReading to_gear_reading(const py::dict& gears, int joints);

/// What is available, the other way round.
py::dict to_dict(const GearReading& gears, int joints);

/// The first `joints` entries as an array of shape [joints].
py::array_t<double> to_numpy(const JointArray& values, int joints);

}  // namespace quasilpv::bindings
