// Canonical bytes of a document: RFC 8785 JSON and RFC 8949 section 4.2 CBOR.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "document/document.hpp"
#include "document/document_limits.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

constexpr double kMaxExactInteger = 9007199254740991.0;  // 2^53 - 1

[[noreturn]] void refuse(const std::string& field, const std::string& got, const std::string& expected) {
  throw InputError("document", field, got, expected);
}

void check_depth(int depth) {
  if (depth > kMaxDocumentDepth) {
    refuse("nesting", "more than " + std::to_string(kMaxDocumentDepth) + " levels", "at most that many");
  }
}

void check_key(const std::string& key) {
  if (!is_ascii(key)) {
    refuse("member name", "a name with characters outside ASCII", "ASCII");
  }
}

double checked_number(const Json& value) {
  const double number = value.get<double>();
  if (!std::isfinite(number)) {
    refuse("number", "NaN or Inf", "a finite number");
  }
  return number == 0.0 ? 0.0 : number;  // -0 is written as 0
}

std::string quoted(const std::string& text) {
  try {
    return Json(text).dump();  // escapes exactly as RFC 8785 section 3.2.2.2 asks
  } catch (const Json::type_error&) {
    refuse("text", "bytes that are not UTF-8", "UTF-8");
  }
}

void write_json(const Json& value, int depth, std::string& out) {
  if (value.is_object()) {
    check_depth(depth);
    char separator = '{';
    for (const auto& [key, member] : value.items()) {  // nlohmann keeps members sorted by byte
      check_key(key);
      out += separator;
      out += quoted(key);
      out += ':';
      write_json(member, depth + 1, out);
      separator = ',';
    }
    out += value.empty() ? "{}" : "}";
  } else if (value.is_array()) {
    check_depth(depth);
    char separator = '[';
    for (const Json& element : value) {
      out += separator;
      write_json(element, depth + 1, out);
      separator = ',';
    }
    out += value.empty() ? "[]" : "]";
  } else if (value.is_number()) {
    out += canonical_number(checked_number(value));
  } else if (value.is_string()) {
    out += quoted(value.get_ref<const std::string&>());
  } else if (value.is_boolean() || value.is_null()) {
    out += value.dump();
  } else {
    refuse("value", "a byte string", "an object, array, string, boolean, null or number");
  }
}

void put_big_endian(std::uint64_t value, int bytes, std::string& out) {
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) {
    out += static_cast<char>((value >> shift) & 0xffu);
  }
}

// Initial byte and argument of a data item, in the shortest form (RFC 8949 section 3).
void put_head(unsigned major_type, std::uint64_t argument, std::string& out) {
  const unsigned major_bits = major_type << 5;
  if (argument < 24) {
    put_big_endian(major_bits | argument, 1, out);
  } else if (argument <= 0xffu) {
    put_big_endian(major_bits | 24u, 1, out);
    put_big_endian(argument, 1, out);
  } else if (argument <= 0xffffu) {
    put_big_endian(major_bits | 25u, 1, out);
    put_big_endian(argument, 2, out);
  } else if (argument <= 0xffffffffu) {
    put_big_endian(major_bits | 26u, 1, out);
    put_big_endian(argument, 4, out);
  } else {
    put_big_endian(major_bits | 27u, 1, out);
    put_big_endian(argument, 8, out);
  }
}

// IEEE 754 binary16 bits of a positive non-integral number, if it has exactly that value; false otherwise.
bool half_bits(double magnitude, std::uint16_t& bits) {
  int exponent = 0;
  const double mantissa = std::frexp(magnitude, &exponent);  // magnitude = mantissa * 2^exponent, mantissa in [1/2, 1)
  const bool normal = exponent >= -13 && exponent <= 16;
  if (!normal && exponent > 16) {
    return false;
  }
  const double significand = normal ? std::ldexp(mantissa, 11) : std::ldexp(magnitude, 24);
  if (significand != std::floor(significand) || significand == 0.0) {
    return false;
  }
  const auto integer = static_cast<unsigned>(significand);
  bits = static_cast<std::uint16_t>(normal ? (static_cast<unsigned>(exponent + 13) << 10) + integer : integer);
  return true;
}

void put_number(double value, std::string& out) {
  if (value == std::floor(value) && std::abs(value) <= kMaxExactInteger) {
    const auto integer = static_cast<std::int64_t>(value);
    put_head(integer < 0 ? 1 : 0, static_cast<std::uint64_t>(integer < 0 ? -1 - integer : integer), out);
    return;
  }
  std::uint16_t half = 0;
  if (half_bits(std::abs(value), half)) {
    put_big_endian(0xf9, 1, out);
    put_big_endian(half | (value < 0 ? 0x8000u : 0u), 2, out);
    return;
  }
  const bool fits_single =
      std::abs(value) <= std::numeric_limits<float>::max() && double{static_cast<float>(value)} == value;
  if (fits_single) {
    const auto single = static_cast<float>(value);
    std::uint32_t bits = 0;
    std::memcpy(&bits, &single, sizeof bits);
    put_big_endian(0xfa, 1, out);
    put_big_endian(bits, 4, out);
    return;
  }
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  put_big_endian(0xfb, 1, out);
  put_big_endian(bits, 8, out);
}

void put_text(const std::string& text, std::string& out) {
  put_head(3, text.size(), out);
  out += text;
}

void write_cbor(const Json& value, int depth, std::string& out) {
  if (value.is_object()) {
    check_depth(depth);
    std::vector<const std::string*> keys;
    for (const auto& item : value.get_ref<const Json::object_t&>()) {
      check_key(item.first);
      keys.push_back(&item.first);
    }
    // The bytewise order of encoded keys is: shorter first, then by byte, because the head holds the length.
    std::sort(keys.begin(), keys.end(), [](const std::string* a, const std::string* b) {
      return a->size() != b->size() ? a->size() < b->size() : *a < *b;
    });
    put_head(5, keys.size(), out);
    for (const std::string* key : keys) {
      put_text(*key, out);
      write_cbor(value.at(*key), depth + 1, out);
    }
  } else if (value.is_array()) {
    check_depth(depth);
    put_head(4, value.size(), out);
    for (const Json& element : value) {
      write_cbor(element, depth + 1, out);
    }
  } else if (value.is_number()) {
    put_number(checked_number(value), out);
  } else if (value.is_string()) {
    (void)quoted(value.get_ref<const std::string&>());  // refuses what is not UTF-8
    put_text(value.get_ref<const std::string&>(), out);
  } else if (value.is_boolean()) {
    put_big_endian(value.get<bool>() ? 0xf5 : 0xf4, 1, out);
  } else if (value.is_null()) {
    put_big_endian(0xf6, 1, out);
  } else {
    refuse("value", "a byte string", "an object, array, string, boolean, null or number");
  }
}

}  // namespace

std::string canonical_number(double value) {
  if (value == 0.0) {
    return "0";
  }
  // Shortest digits that round-trip, as d.ddde[+-]xx, then laid out as ECMAScript's Number::toString does.
  std::array<char, 32> buffer{};
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), std::abs(value), std::chars_format::scientific);
  const std::string_view scientific(buffer.data(), static_cast<std::size_t>(end.ptr - buffer.data()));
  const std::size_t exponent_mark = scientific.find('e');
  std::string digits(1, scientific[0]);
  if (exponent_mark > 2) {
    digits += scientific.substr(2, exponent_mark - 2);
  }
  const int exponent = std::stoi(std::string(scientific.substr(exponent_mark + 1)));

  const int digit_count = static_cast<int>(digits.size());
  const int point = exponent + 1;  // value = 0.digits * 10^point
  std::string text;
  if (point >= digit_count && point <= 21) {
    text = digits + std::string(static_cast<std::size_t>(point - digit_count), '0');
  } else if (point > 0 && point <= 21) {
    text = digits.substr(0, static_cast<std::size_t>(point)) + "." + digits.substr(static_cast<std::size_t>(point));
  } else if (point > -6 && point <= 0) {
    text = "0." + std::string(static_cast<std::size_t>(-point), '0') + digits;
  } else {
    text = digits.substr(0, 1) + (digit_count > 1 ? "." + digits.substr(1) : "") + (exponent < 0 ? "e-" : "e+") +
           std::to_string(std::abs(exponent));
  }
  return value < 0.0 ? "-" + text : text;
}

std::string canonical_json(const Json& document) {
  std::string out;
  write_json(document, 1, out);
  return out;
}

std::string canonical_cbor(const Json& document) {
  std::string out;
  write_cbor(document, 1, out);
  return out;
}

}  // namespace quasilpv
