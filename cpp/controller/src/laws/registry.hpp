// All kinds of laws that an artifact can have.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "document/field.hpp"
#include "document/member_table.hpp"
#include "quasilpv/law_parameters.hpp"

namespace quasilpv {

/// One kind of law: its name in artifacts, the schema of its document, and its parameters from that document.
struct LawKind {
  std::string name;
  std::vector<Member> members;        ///< of the member `law` of an artifact, `kind` left out
  std::vector<std::string> programs;  ///< of its member `programs`
  /// INIT-ONLY. Throws InputError.
  std::function<std::shared_ptr<const LawParameters>(const Field& law, const Field& programs, int joints)> read;
};

/// In the order of `docs/reference/formats.md`. INIT-ONLY.
const std::vector<LawKind>& law_kinds();

/// The parameters of the law of an artifact. INIT-ONLY. Throws InputError for an unknown kind, and as its `read` does.
std::shared_ptr<const LawParameters> read_law(const Field& law, const Field& programs, int joints);

}  // namespace quasilpv
