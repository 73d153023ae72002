// Choosing one of a list of kinds by the member `kind` of a document.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "document/field.hpp"

namespace quasilpv {

/// The entry of `kinds` whose `name` stands in `field`. INIT-ONLY. Throws InputError.
template <class Kind>
const Kind& find_kind(const std::vector<Kind>& kinds, const Field& field) {
  const std::string name = field.text();
  const auto found = std::find_if(kinds.begin(), kinds.end(), [&name](const Kind& kind) { return kind.name == name; });
  if (found == kinds.end()) {
    std::vector<std::string> names(kinds.size());
    std::transform(kinds.begin(), kinds.end(), names.begin(), [](const Kind& kind) { return kind.name; });
    field.fail_choice(names);
  }
  return *found;
}

}  // namespace quasilpv
