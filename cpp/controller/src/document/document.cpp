// Strict reading of documents: one SAX reader for both twins, then the comparison with the canonical bytes.
#include "document/document.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "document/document_limits.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

using Format = nlohmann::detail::input_format_t;

// Builds the document while refusing what the data model does not know: deep nesting (which would also exhaust the
// stack of the CBOR parser), duplicate or non-ASCII keys, byte strings, NaN and Inf, text that is not UTF-8.
class StrictReader final : public nlohmann::json_sax<Json> {
 public:
  explicit StrictReader(std::string source) : source_(std::move(source)) {}

  Json take() { return std::move(root_); }

  bool null() override { return put(nullptr) != nullptr; }
  bool boolean(bool value) override { return put(value) != nullptr; }
  bool number_integer(number_integer_t value) override { return put(value) != nullptr; }
  bool number_unsigned(number_unsigned_t value) override { return put(value) != nullptr; }
  bool number_float(number_float_t value, const string_t& /*literal*/) override {
    if (!std::isfinite(value)) {
      refuse(place(), "NaN or Inf", "a finite number");
    }
    return put(value) != nullptr;
  }
  bool string(string_t& value) override {
    if (!is_utf8(value)) {
      refuse(place(), "bytes that are not UTF-8", "text in UTF-8");
    }
    return put(std::move(value)) != nullptr;
  }
  bool binary(binary_t& /*value*/) override {
    refuse(place(), "a byte string", "text, a number, an array or an object");
  }

  bool start_object(std::size_t /*elements*/) override { return open(Json::object()); }
  bool end_object() override { return close(); }
  bool start_array(std::size_t /*elements*/) override { return open(Json::array()); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    if (!is_ascii(name)) {
      refuse("member name", "a name with characters outside ASCII", "ASCII");
    }
    key_ = name;
    if (open_.back()->contains(name)) {
      refuse(place(), "a second member of that name", "distinct member names");
    }
    return true;
  }

  bool parse_error(std::size_t position, const std::string& /*last_token*/,
                   const nlohmann::detail::exception& /*error*/) override {
    refuse("byte " + std::to_string(position), "something that does not parse", "well-formed JSON or CBOR");
  }

 private:
  [[noreturn]] void refuse(const std::string& field, const std::string& got, const std::string& expected) const {
    throw InputError(source_, field, got, expected);
  }

  static bool is_utf8(const std::string& text) {
    try {
      (void)Json(text).dump();
      return true;
    } catch (const Json::type_error&) {
      return false;
    }
  }

  std::string place() const { return key_.empty() ? "document" : key_; }

  // A child stays where it is while it is open: its parent only grows after it is closed.
  Json* put(Json value) {
    if (open_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    Json& parent = *open_.back();
    if (parent.is_array()) {
      parent.push_back(std::move(value));
      return &parent.back();
    }
    return &(parent[key_] = std::move(value));
  }

  bool open(Json container) {
    if (open_.size() == static_cast<std::size_t>(kMaxDocumentDepth)) {
      refuse(place(), "more than " + std::to_string(kMaxDocumentDepth) + " levels of nesting", "at most that many");
    }
    open_.push_back(put(std::move(container)));
    return true;
  }

  bool close() {
    open_.pop_back();
    return true;
  }

  std::string source_;
  Json root_;
  std::string key_;
  std::vector<Json*> open_;
};

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

void check_size(std::string_view bytes, const std::string& source) {
  if (bytes.empty() || bytes.size() > kMaxDocumentBytes) {
    throw InputError(source, "size", std::to_string(bytes.size()) + " bytes",
                     "between 1 and " + std::to_string(kMaxDocumentBytes) + " bytes");
  }
}

Json read(std::string_view bytes, Format format, const std::string& source) {
  StrictReader reader(source);
  Json::sax_parse(bytes.begin(), bytes.end(), &reader, format);
  return reader.take();
}

// Offset of the first byte in which the two differ.
std::size_t first_difference(std::string_view a, std::string_view b) {
  return static_cast<std::size_t>(std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first - a.begin());
}

}  // namespace

Json parse_document(std::string_view bytes, const std::string& source) {
  check_size(bytes, source);
  const bool is_json = bytes.front() == '{';
  const bool is_cbor = static_cast<unsigned char>(bytes.front()) >> 5 == 5;  // major type 5: a map
  if (!is_json && !is_cbor) {
    throw InputError(source, "byte 0", "neither a JSON nor a CBOR object", "'{' or a CBOR map");
  }
  Json document = read(bytes, is_json ? Format::json : Format::cbor, source);
  const std::string canonical = is_json ? canonical_json(document) : canonical_cbor(document);
  if (bytes != canonical) {
    throw InputError(source, "byte " + std::to_string(first_difference(bytes, canonical)),
                     "bytes that are not canonical", "the canonical serialisation of the document");
  }

  const Field hash = Field(document, source, "")["hash"];
  const std::string stated = hash.text();
  Json unhashed = document;
  unhashed.erase("hash");
  const std::string computed = sha256_hex(canonical_json(unhashed));
  if (stated != computed) {
    hash.fail(Json(stated).dump(), "the SHA-256 of the content, " + computed);
  }
  return document;
}

Json parse_strict_json(std::string_view bytes, const std::string& source) {
  check_size(bytes, source);
  // nlohmann skips a byte order mark, which JSON does not have (RFC 8259, 8.1).
  if (bytes.substr(0, kByteOrderMark.size()) == kByteOrderMark) {
    throw InputError(source, "byte 0", "a byte order mark", "well-formed JSON");
  }
  // nlohmann takes a zero byte for the end of the input, which would hide whatever follows it.
  const std::size_t zero = bytes.find('\0');
  if (zero != std::string_view::npos) {
    throw InputError(source, "byte " + std::to_string(zero), "a zero byte", "well-formed JSON");
  }
  return read(bytes, Format::json, source);
}

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) {
    throw InputError(path, "file", "nothing that can be opened", "a readable file");
  }
  const std::streamoff size = file.tellg();
  if (size < 0 || size > static_cast<std::streamoff>(kMaxDocumentBytes)) {
    throw InputError(path, "file", size < 0 ? "no size" : std::to_string(size) + " bytes",
                     "a regular file of at most " + std::to_string(kMaxDocumentBytes) + " bytes");
  }
  std::string bytes(static_cast<std::size_t>(size), '\0');
  file.seekg(0);
  if (!file.read(bytes.data(), size)) {
    throw InputError(path, "file", "an error while reading", "a readable file");
  }
  return bytes;
}

}  // namespace quasilpv
