// Authenticated mode: a secret that both sides hold, and the tag it puts behind every message.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace quasilpv {

/// A shared secret. The tag of a message is keyed BLAKE2b (RFC 7693) over all its bytes, by libsodium's
/// crypto_generichash(): type, session, artifact, seq and sender are among them, so a message passes for no other one.
/// Whoever does not hold the key can neither make nor change a message; the content is not encrypted.
class MessageKey {
 public:
  static constexpr std::size_t kKeyBytes = 32;
  static constexpr std::size_t kTagBytes = 16;

  /// Reads 64 hexadecimal digits, one line, from a regular file of mode 0600. INIT-ONLY. Throws InputError naming the
  /// file, what was found and what was expected; the message never holds the content.
  static MessageKey load(const std::string& path);
  explicit MessageKey(const std::array<std::uint8_t, kKeyBytes>& secret);
  MessageKey(const MessageKey&) = default;
  MessageKey& operator=(const MessageKey&) = default;
  /// Wipes the secret.
  ~MessageKey();

  /// Writes the tag of `size` bytes. RT-SAFE (bounded, no allocation, no lock, no throw).
  void sign(const std::uint8_t* bytes, std::size_t size, std::uint8_t* tag) const noexcept;

  /// Whether `tag` belongs to these bytes, in a time that does not depend on where it differs. RT-SAFE (bounded, no
  /// allocation, no lock, no throw).
  bool is_authentic(const std::uint8_t* bytes, std::size_t size, const std::uint8_t* tag) const noexcept;

 private:
  std::array<std::uint8_t, kKeyBytes> secret_{};
};

}  // namespace quasilpv
