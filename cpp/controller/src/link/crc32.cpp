#include "quasilpv/crc32.hpp"

#include <array>

namespace quasilpv {
namespace {

constexpr std::array<std::uint32_t, 256> make_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t byte = 0; byte < table.size(); ++byte) {
    std::uint32_t remainder = byte;
    for (int bit = 0; bit < 8; ++bit) {
      remainder = (remainder >> 1) ^ ((remainder & 1u) != 0 ? 0xEDB88320u : 0u);
    }
    table[byte] = remainder;
  }
  return table;
}

constexpr std::array<std::uint32_t, 256> kTable = make_table();

}  // namespace

std::uint32_t crc32(const void* bytes, std::size_t size) noexcept {
  const auto* data = static_cast<const std::uint8_t*>(bytes);
  std::uint32_t remainder = 0xFFFFFFFFu;
  for (std::size_t i = 0; i < size; ++i) {
    remainder = (remainder >> 8) ^ kTable[(remainder ^ data[i]) & 0xFFu];
  }
  return remainder ^ 0xFFFFFFFFu;
}

}  // namespace quasilpv
