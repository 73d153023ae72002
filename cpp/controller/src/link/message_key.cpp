#include "quasilpv/message_key.hpp"

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

constexpr const char* kExpectedContent = "64 hexadecimal digits on one line";
constexpr std::size_t kDigits = 2 * MessageKey::kKeyBytes;
constexpr ::mode_t kPermissions = 0777;
constexpr ::mode_t kOwnerOnly = 0600;

/// An open file, closed on every way out.
class OpenFile {
 public:
  explicit OpenFile(const std::string& path) : descriptor_(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
    if (descriptor_ < 0) {
      throw InputError(path, "key", std::strerror(errno), "a file that can be read");
    }
  }
  ~OpenFile() { close(descriptor_); }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  int descriptor() const noexcept { return descriptor_; }

 private:
  int descriptor_;
};

std::string octal(::mode_t mode) {
  std::string digits = "0";
  for (const int shift : {6, 3, 0}) {
    digits += static_cast<char>('0' + ((mode >> shift) & 7u));
  }
  return digits;
}

/// A secret that others on this machine can read is none.
void require_private(int descriptor, const std::string& path) {
  struct stat status {};
  if (fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    throw InputError(path, "key", "not a regular file", "a regular file of mode 0600");
  }
  if ((status.st_mode & kPermissions) != kOwnerOnly) {
    throw InputError(path, "key", "mode " + octal(status.st_mode), "mode 0600 (chmod 600)");
  }
}

}  // namespace

MessageKey MessageKey::load(const std::string& path) {
  const OpenFile file(path);
  require_private(file.descriptor(), path);
  std::array<char, kDigits + 2> text{};  // a newline, and one more to see that the file ends there
  const ssize_t size = read(file.descriptor(), text.data(), text.size());
  std::array<std::uint8_t, kKeyBytes> secret{};
  std::size_t decoded = 0;
  const bool is_line = size == kDigits || (size == kDigits + 1 && text[kDigits] == '\n');
  const bool is_key =
      is_line && sodium_hex2bin(secret.data(), secret.size(), text.data(), kDigits, nullptr, &decoded, nullptr) == 0 &&
      decoded == secret.size();
  sodium_memzero(text.data(), text.size());
  if (!is_key) {
    throw InputError(path, "key", is_line ? "other characters" : "another length", kExpectedContent);
  }
  MessageKey key(secret);
  sodium_memzero(secret.data(), secret.size());
  return key;
}

MessageKey::MessageKey(const std::array<std::uint8_t, kKeyBytes>& secret) : secret_(secret) {
  if (sodium_init() < 0) {
    throw std::runtime_error("libsodium could not be initialised");
  }
}

MessageKey::~MessageKey() { sodium_memzero(secret_.data(), secret_.size()); }

void MessageKey::sign(const std::uint8_t* bytes, std::size_t size, std::uint8_t* tag) const noexcept {
  crypto_generichash(tag, kTagBytes, bytes, size, secret_.data(), secret_.size());
}

bool MessageKey::is_authentic(const std::uint8_t* bytes, std::size_t size, const std::uint8_t* tag) const noexcept {
  std::array<std::uint8_t, kTagBytes> expected{};
  sign(bytes, size, expected.data());
  return sodium_memcmp(expected.data(), tag, kTagBytes) == 0;
}

}  // namespace quasilpv
