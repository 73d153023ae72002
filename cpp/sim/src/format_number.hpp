// Numbers in error messages.
#pragma once

#include <sstream>
#include <string>

namespace quasilpv {

/// A number with nine digits. RT-UNSAFE.
inline std::string format_number(double value) {
  std::ostringstream out;
  out.precision(9);
  out << value;
  return out.str();
}

}  // namespace quasilpv
