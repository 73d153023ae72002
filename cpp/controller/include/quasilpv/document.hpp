// Canonical documents (docs/reference/formats.md): strict reading of the JSON and CBOR twins, and their hash.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace quasilpv {

using Json = nlohmann::json;

/// No number that is read from a document is larger, and no positive one smaller than its reciprocal: products of a few
/// of them are finite.
inline constexpr double kLargestReadNumber = 1e100;

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

/// A cursor into a parsed document that knows its path: every error names the field, what was found and what was
/// expected.
class Field {
 public:
  Field(const Json& value, std::string source, std::string path)
      : value_(&value), source_(std::move(source)), path_(std::move(path)) {}

  const Json& json() const { return *value_; }
  const std::string& path() const { return path_; }
  [[noreturn]] void fail(const std::string& got, const std::string& expected) const;

  /// Member of an object; missing is an error.
  Field operator[](const std::string& key) const;
  /// Element of an array.
  Field at(std::size_t index) const;
  /// Refuses an object with members other than `allowed`.
  void only(std::initializer_list<const char*> allowed) const;
  bool has(const std::string& key) const;
  bool is_null() const;

  std::size_t size() const;  ///< of an array
  /// A number of at most `largest` in magnitude.
  double number(double largest = kLargestReadNumber) const;
  /// From `smallest` to `largest`.
  double positive(double smallest = 1.0 / kLargestReadNumber, double largest = kLargestReadNumber) const;
  /// From 0 to `largest`.
  double non_negative(double largest = kLargestReadNumber) const;
  bool boolean() const;
  std::int64_t integer(std::int64_t low, std::int64_t high) const;
  std::string text() const;
  std::vector<double> numbers(std::size_t expected_size, double largest = kLargestReadNumber) const;
  void expect_text(const std::string& expected) const;

 private:
  double within(double low, double high, const std::string& expected) const;

  const Json* value_;
  std::string source_;
  std::string path_;
};

}  // namespace quasilpv
