// What the data model of a document allows (docs/reference/formats.md), for its reader and its writers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace quasilpv {

inline constexpr int kMaxDocumentDepth = 32;
inline constexpr std::size_t kMaxDocumentBytes = std::size_t{64} << 20;

inline bool is_ascii(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x80; });
}

}  // namespace quasilpv
