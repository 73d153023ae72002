// Python trees to documents and back.
#include <cmath>
#include <cstdint>

#include "bindings.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv::bindings {
namespace {

constexpr double kLargestExactInteger = 9007199254740991.0;  // 2^53 - 1
constexpr int kDepthLimit = 256;  // against unbounded recursion; documents have a tighter limit of their own

Json convert(const py::handle& value, int depth);

Json object_to_json(const py::dict& members, int depth) {
  Json object = Json::object();
  for (const auto& [key, member] : members) {
    if (!py::isinstance<py::str>(key)) {
      throw InputError("argument", "document", "a key of type " + std::string(py::str(py::type::of(key))), "a string");
    }
    object[key.cast<std::string>()] = convert(member, depth);
  }
  return object;
}

Json array_to_json(const py::sequence& elements, int depth) {
  Json array = Json::array();
  for (const py::handle element : elements) {
    array.push_back(convert(element, depth));
  }
  return array;
}

Json convert(const py::handle& value, int depth) {
  if (depth > kDepthLimit) {
    throw InputError("argument", "document", "more than " + std::to_string(kDepthLimit) + " levels", "fewer levels");
  }
  if (value.is_none()) {
    return nullptr;
  }
  if (py::isinstance<py::bool_>(value)) {
    return value.cast<bool>();
  }
  if (py::isinstance<py::int_>(value) || py::isinstance<py::float_>(value)) {
    return value.cast<double>();
  }
  if (py::isinstance<py::str>(value)) {
    return value.cast<std::string>();
  }
  if (py::isinstance<py::dict>(value)) {
    return object_to_json(py::reinterpret_borrow<py::dict>(value), depth + 1);
  }
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    return array_to_json(py::reinterpret_borrow<py::sequence>(value), depth + 1);
  }
  throw InputError("argument", "document", "a value of type " + std::string(py::str(py::type::of(value))),
                   "dict, list, tuple, str, bool, None, int or float");
}

py::object number_to_python(double number) {
  if (std::trunc(number) == number && std::abs(number) <= kLargestExactInteger) {
    return py::int_(static_cast<std::int64_t>(number));
  }
  return py::float_(number);
}

}  // namespace

Json to_json(const py::handle& value) { return convert(value, 0); }

py::object to_python(const Json& value) {
  switch (value.type()) {
    case Json::value_t::object: {
      py::dict members;
      for (const auto& [key, member] : value.items()) {
        members[py::str(key)] = to_python(member);
      }
      return members;
    }
    case Json::value_t::array: {
      py::list elements;
      for (const Json& element : value) {
        elements.append(to_python(element));
      }
      return elements;
    }
    case Json::value_t::string:
      return py::str(value.get_ref<const std::string&>());
    case Json::value_t::boolean:
      return py::bool_(value.get<bool>());
    case Json::value_t::number_integer:
    case Json::value_t::number_unsigned:
    case Json::value_t::number_float:
      return number_to_python(value.get<double>());
    default:
      return py::none();
  }
}

}  // namespace quasilpv::bindings
