#include "quasilpv/crc32.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

namespace quasilpv {
namespace {

/// The definition itself: the remainder of the message polynomial, one bit at a time.
std::uint32_t bitwise_crc32(const std::vector<std::uint8_t>& bytes) {
  std::uint32_t remainder = 0xFFFFFFFFu;
  for (const std::uint8_t byte : bytes) {
    for (int bit = 0; bit < 8; ++bit) {
      const bool feedback = ((remainder ^ (byte >> bit)) & 1u) != 0;
      remainder = (remainder >> 1) ^ (feedback ? 0xEDB88320u : 0u);
    }
  }
  return remainder ^ 0xFFFFFFFFu;
}

TEST(Crc32, agrees_with_the_published_check_values) {
  // "Check" of CRC-32/ISO-HDLC in the catalogue of Cook: https://reveng.sourceforge.io/crc-catalogue
  const std::string digits = "123456789";
  EXPECT_EQ(crc32(digits.data(), digits.size()), 0xCBF43926u);
  EXPECT_EQ(crc32(nullptr, 0), 0u);
  EXPECT_EQ(crc32("a", 1), 0xE8B7BE43u);
}

TEST(Crc32, agrees_with_the_bitwise_definition_on_random_bytes) {
  std::mt19937 random(1);
  for (std::size_t size = 0; size < 300; ++size) {
    std::vector<std::uint8_t> bytes(size);
    for (std::uint8_t& byte : bytes) {
      byte = static_cast<std::uint8_t>(random());
    }
    ASSERT_EQ(crc32(bytes.data(), bytes.size()), bitwise_crc32(bytes)) << size << " bytes";
  }
}

TEST(Crc32, when_any_burst_of_up_to_32_bits_is_flipped_expect_a_different_value) {
  std::mt19937 random(2);
  std::vector<std::uint8_t> bytes(136);
  for (std::uint8_t& byte : bytes) {
    byte = static_cast<std::uint8_t>(random());
  }
  const std::uint32_t original = crc32(bytes.data(), bytes.size());
  for (std::size_t first = 0; first + 32 <= bytes.size() * 8; ++first) {
    const std::uint32_t burst = static_cast<std::uint32_t>(random()) | 1u;
    std::vector<std::uint8_t> damaged = bytes;
    for (std::size_t bit = 0; bit < 32; ++bit) {
      damaged[(first + bit) / 8] ^= static_cast<std::uint8_t>(((burst >> bit) & 1u) << ((first + bit) % 8));
    }
    ASSERT_NE(crc32(damaged.data(), damaged.size()), original) << "burst from bit " << first;
  }
}

}  // namespace
}  // namespace quasilpv
