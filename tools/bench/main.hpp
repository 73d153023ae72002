// What the main functions of the benchmark programs share: positional arguments in, one line of JSON out.
#pragma once

#include <exception>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "quasilpv/decimal.hpp"

namespace quasilpv::bench {

/// A number of things on the command line. Throws InputError.
inline int count(const std::string& text) {
  return static_cast<int>(parse_integer(text, "command line", "count", 1, 1'000'000'000));
}

/// Calls `measure(arguments)` and prints the JSON it returns. Returns the exit code: 0, or 2 with one line on stderr if
/// the number of arguments is wrong or `measure` throws.
template <class Measure>
int run_benchmark(int argc, char** argv, const std::vector<std::string>& names, const Measure& measure) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() != names.size()) {
    std::cerr << "usage: " << argv[0];
    for (const std::string& name : names) {
      std::cerr << ' ' << name;
    }
    std::cerr << '\n';
    return 2;
  }
  try {
    const nlohmann::json report = measure(arguments);
    std::cout << report << '\n';
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 2;
  }
  return 0;
}

}  // namespace quasilpv::bench
