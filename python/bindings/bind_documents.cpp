// Canonical documents: for comparing the two languages byte by byte.
#include "bindings.hpp"
#include "document/document.hpp"
#include "laws/registry.hpp"

namespace quasilpv::bindings {
namespace {

py::dict to_python(const std::vector<Member>& members) {
  py::dict schema;
  for (const Member& member : members) {
    schema[py::str(member.name)] = py::make_tuple(member.type, member.optional, to_python(member.members));
  }
  return schema;
}

/// What the readers of the laws know: name of the kind -> (members of `law`, names of `programs`).
py::dict law_schemas() {
  py::dict schemas;
  for (const LawKind& kind : law_kinds()) {
    py::list programs;
    for (const std::string& name : kind.programs) {
      programs.append(name);
    }
    schemas[py::str(kind.name)] = py::make_tuple(to_python(kind.members), programs);
  }
  return schemas;
}

}  // namespace

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
  module.def(
      "law_schemas", &law_schemas,
      "Kind of a law -> ({member: (type, optional, {member of it: ...})}, [program, ...]), as its reader has it.");
}

}  // namespace quasilpv::bindings
