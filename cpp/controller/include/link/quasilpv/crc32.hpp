// Checksum of the messages on the wire.
#pragma once

#include <cstddef>
#include <cstdint>

namespace quasilpv {

/// CRC-32 of IEEE 802.3 (reflected polynomial 0xEDB88320, initial value and final xor 0xFFFFFFFF): the one of zlib and
/// PNG. Detects every error burst of up to 32 bits; it catches accidents, not attackers. RT-SAFE (bounded, no
/// allocation, no lock, no throw).
///
/// @param bytes  first byte, may be null if `size` is 0
/// @param size   number of bytes
std::uint32_t crc32(const void* bytes, std::size_t size) noexcept;

}  // namespace quasilpv
