#include "quasilpv/decimal.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <sstream>

#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

constexpr std::size_t kMaxShown = 40;

template <class Number>
bool read_whole(const std::string& text, Number& value) {
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && rest == end;
}

}  // namespace

double parse_number(const std::string& text, const std::string& source, const std::string& field, double low,
                    double high) {
  double value = std::nan("");
  if (!read_whole(text, value) || !std::isfinite(value) || value < low || value > high) {
    throw InputError(source, field, quoted(text), "a number from " + format_number(low) + " to " + format_number(high));
  }
  return value;
}

std::int64_t parse_integer(const std::string& text, const std::string& source, const std::string& field,
                           std::int64_t low, std::int64_t high) {
  std::int64_t value = 0;
  if (!read_whole(text, value) || value < low || value > high) {
    throw InputError(source, field, quoted(text),
                     "a whole number from " + std::to_string(low) + " to " + std::to_string(high));
  }
  return value;
}

std::string quoted(const std::string& text) {
  const bool is_long = text.size() > kMaxShown;
  return "\"" + on_one_line(is_long ? text.substr(0, kMaxShown) : text) + (is_long ? "...\"" : "\"");
}

std::string on_one_line(const std::string& message) {
  constexpr const char* kHex = "0123456789abcdef";
  std::string line;
  for (const char character : message) {
    const auto byte = static_cast<unsigned char>(character);
    if (character == '\n') {
      line += "\\n";
    } else if (character == '\t') {
      line += "\\t";
    } else if (byte < 0x20 || byte == 0x7f) {
      line.append({'\\', 'x', kHex[byte >> 4], kHex[byte & 15u]});
    } else {
      line += character;
    }
  }
  return line;
}

std::string format_number(double value) {
  std::ostringstream out;
  out.precision(9);
  out << value;
  return out.str();
}

}  // namespace quasilpv
