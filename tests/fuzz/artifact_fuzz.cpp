// The artifact decoder under any bytes. Built twice: FUZZ_CBOR 0 for the JSON twin, 1 for the CBOR twin.
//
// Random bytes never have the right hash, so each input is used twice: as it is, and, where it parses at all, with its
// hash put right, which lets it through to the reading of the law. Anything but acceptance or InputError is a finding.
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "document/document.hpp"
#include "quasilpv/artifact.hpp"
#include "quasilpv/errors.hpp"

namespace {

using namespace quasilpv;  // NOLINT(google-build-using-namespace): this file is the program

// Nesting is refused by our own reader, but seal() parses with the library's, whose stack grows with the depth.
constexpr std::size_t kLongestSealed = 1 << 15;

std::string canonical(const Json& document) {
#if FUZZ_CBOR
  return canonical_cbor(document);
#else
  return canonical_json(document);
#endif
}

void require(bool holds) {
  if (!holds) {
    std::abort();
  }
}

/// What is accepted is canonical.
void parse_as_it_is(std::string_view bytes) {
  try {
    require(canonical(parse_document(bytes, "fuzz")) == bytes);
  } catch (const InputError&) {
    return;
  }
}

/// The document without any of our checks, by the library's own parser; null if there is none.
Json parse_loosely(std::string_view bytes) {
  try {
#if FUZZ_CBOR
    return Json::from_cbor(bytes);
#else
    return Json::parse(bytes);
#endif
  } catch (const Json::exception&) {
    return nullptr;
  }
}

/// The bytes of the same document with the right hash; throws InputError if it cannot be one.
std::string seal(std::string_view bytes) {
  Json document = parse_loosely(bytes);
  if (!document.is_object()) {
    throw InputError("fuzz", "document", "no object", "an object");
  }
  document.erase("hash");
  document["hash"] = sha256_hex(canonical_json(document));
  return canonical(document);
}

/// Both twins of what is accepted are the same artifact.
void parse_sealed(std::string_view bytes) {
  try {
    const std::string sealed = seal(bytes);
    const Artifact artifact = Artifact::parse(sealed, "fuzz");
    const Json document = parse_document(sealed, "fuzz");
    require(Artifact::parse(canonical_json(document), "fuzz").hash() == artifact.hash());
    require(Artifact::parse(canonical_cbor(document), "fuzz").hash() == artifact.hash());
  } catch (const InputError&) {
    return;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  parse_as_it_is(bytes);
  if (size <= kLongestSealed) {
    parse_sealed(bytes);
  }
  return 0;
}
