// Canonical documents: for comparing the two languages byte by byte.
#include "bindings.hpp"

namespace quasilpv::bindings {

void bind_documents(py::module_& module) {
  module.def(
      "canonical_json", [](const py::object& document) { return py::bytes(canonical_json(to_json(document))); },
      py::arg("document"), "RFC 8785 bytes of a tree of dict, list, str, bool, None, int and float.");
  module.def(
      "canonical_cbor", [](const py::object& document) { return py::bytes(canonical_cbor(to_json(document))); },
      py::arg("document"), "Deterministic CBOR bytes (RFC 8949 section 4.2) of the same trees.");
  module.def(
      "parse_document",
      [](const py::bytes& data, const std::string& source) {
        return to_python(parse_document(static_cast<std::string_view>(data), source));
      },
      py::arg("data"), py::arg("source") = "document",
      "Tree of a hashed document from the bytes of either twin; refused unless canonical and its hash agrees.");
}

}  // namespace quasilpv::bindings
