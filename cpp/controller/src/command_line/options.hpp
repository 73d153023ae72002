// Options of the command lines of both executables. Each has a declared type, which --help shows: NUMBER and INTEGER
// with their bounds, WORD with the words there are, FILE and URL. Only their main files include this (it needs CLI11).
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "quasilpv/decimal.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {

inline constexpr const char* kCommandLine = "command line";

/// Declares `--name TYPE`, whose text goes through `read`. Every option is one: there is no other way to read a value.
template <class Read>
CLI::Option* add_typed(CLI::App& app, const std::string& name, const char* type, const std::string& meaning,
                       Read read) {
  return app.add_option_function<std::string>("--" + name, std::move(read), meaning)->type_name(type);
}

/// A finite decimal number within bounds; throws InputError for anything else, as do the next ones. INIT-ONLY.
inline CLI::Option* add_number(CLI::App& app, const std::string& name, double& value, double low, double high,
                               const std::string& meaning) {
  return add_typed(
      app, name, "NUMBER",
      meaning + " (" + format_number(low) + " to " + format_number(high) + "; default " + format_number(value) + ")",
      [&value, name, low, high](const std::string& text) {
        value = parse_number(text, kCommandLine, name, low, high);
      });
}

/// A whole number within bounds.
template <class Integer>
CLI::Option* add_integer(CLI::App& app, const std::string& name, Integer& value, std::int64_t low, std::int64_t high,
                         const std::string& meaning) {
  return add_typed(app, name, "INTEGER", meaning + " (" + std::to_string(low) + " to " + std::to_string(high) + ")",
                   [&value, name, low, high](const std::string& text) {
                     value = static_cast<Integer>(parse_integer(text, kCommandLine, name, low, high));
                   });
}

/// A switch, which takes no value.
inline CLI::Option* add_switch(CLI::App& app, const std::string& name, bool& value, const std::string& meaning) {
  return app.add_flag("--" + name, value, meaning)->disable_flag_override();
}

/// Throws InputError for `--switch=`, which CLI11 takes for `--switch`.
inline void refuse_empty_switch(const CLI::App& app, int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument.rfind("--", 0) != 0 || argument.back() != '=') {
      continue;
    }
    const std::string name = argument.substr(2, argument.size() - 3);
    const CLI::Option* option = app.get_option_no_throw("--" + name);
    if (option != nullptr && option->get_items_expected_max() == 0) {
      throw InputError(kCommandLine, name, "=", "no value: it is a switch");
    }
  }
}

/// One of the words; the first one is the default.
template <class Value>
CLI::Option* add_word(CLI::App& app, const std::string& name, Value& value,
                      const std::vector<std::pair<std::string, Value>>& words, const std::string& meaning) {
  std::string known;
  for (const auto& [word, unused] : words) {
    known += (known.empty() ? "" : " or ") + word;
  }
  return add_typed(app, name, "WORD", meaning + " (" + known + "; default " + words.front().first + ")",
                   [&value, name, words, known](const std::string& text) {
                     for (const auto& [word, meant] : words) {
                       if (word == text) {
                         value = meant;
                         return;
                       }
                     }
                     throw InputError(kCommandLine, name, quoted(text), known);
                   });
}

/// Any text but none.
inline CLI::Option* add_text(CLI::App& app, const std::string& name, const char* type, std::string& value,
                             const std::string& meaning) {
  return add_typed(app, name, type, meaning, [&value, name](const std::string& text) {
    if (text.empty()) {
      throw InputError(kCommandLine, name, "nothing", "a text");
    }
    value = text;
  });
}

/// The name of a file; whether there is one is the matter of who opens it.
inline CLI::Option* add_file(CLI::App& app, const std::string& name, std::string& value, const std::string& meaning) {
  return add_text(app, name, "FILE", value, meaning);
}

}  // namespace quasilpv
