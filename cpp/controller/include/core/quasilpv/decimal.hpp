// Numbers that people write on a command line: decimal, finite, within bounds.
#pragma once

#include <cstdint>
#include <string>

namespace quasilpv {

/// Reads a decimal number, whole `text`, as JSON writes numbers: no sign +, no hexadecimal, no NaN or infinity, no
/// white space. INIT-ONLY. Throws InputError naming `source` and `field` for anything else, and for a number outside
/// [low, high].
double parse_number(const std::string& text, const std::string& source, const std::string& field, double low,
                    double high);

/// The same for a whole number, digits only: 1e3 is none.
std::int64_t parse_integer(const std::string& text, const std::string& source, const std::string& field,
                           std::int64_t low, std::int64_t high);

/// A text in quotation marks on one line, whatever it holds; long ones are cut. INIT-ONLY.
std::string quoted(const std::string& text);

/// A message on one line: control characters are written as their escapes in C. INIT-ONLY.
std::string on_one_line(const std::string& message);

/// A number with nine digits, as messages show it: 0.001, 86400, 1e+12. RT-UNSAFE.
std::string format_number(double value);

}  // namespace quasilpv
