// Canonical documents (docs/reference/formats.md): strict reading of the JSON and CBOR twins, and their hash.
#pragma once

#include <string>
#include <string_view>

#include "document/field.hpp"

namespace quasilpv {

/// A number as RFC 8785 writes it (ECMAScript, shortest round trip). INIT-ONLY.
std::string canonical_number(double value);

/// RFC 8785 bytes of a document; -0 is written as 0. INIT-ONLY. Throws InputError for NaN/Inf, non-ASCII keys, text
/// that is not UTF-8, depth above 32.
std::string canonical_json(const Json& document);

/// Deterministic CBOR bytes (RFC 8949 section 4.2, integral numbers as integers). INIT-ONLY. Errors as canonical_json.
std::string canonical_cbor(const Json& document);

/// Lower-case hexadecimal SHA-256. INIT-ONLY.
std::string sha256_hex(std::string_view bytes);

/// Parses a hashed document from the bytes of either twin (told apart by the first byte) and accepts it only if the
/// bytes equal their canonical re-serialisation and the hash agrees. `source` names the file in errors. INIT-ONLY.
/// Throws InputError.
Json parse_document(std::string_view bytes, const std::string& source);

/// Strict parse of unhashed JSON (scenario): refuses duplicate keys and anything JSON does not allow. INIT-ONLY. Throws
/// InputError.
Json parse_strict_json(std::string_view bytes, const std::string& source);

/// Reads a whole file of at most 64 MiB. INIT-ONLY. Throws InputError if it cannot be read.
std::string read_file(const std::string& path);

}  // namespace quasilpv
