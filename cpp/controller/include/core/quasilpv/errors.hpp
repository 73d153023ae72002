// Misuse is an exception of one small typed hierarchy, thrown only while loading; outcomes are enums.
#pragma once

#include <stdexcept>
#include <string>

namespace quasilpv {

/// Bad input: a file, field or argument is not what it must be. `what()` is one line: "<source>: <field>: got <got>,
/// expected <expected>".
class InputError : public std::runtime_error {
 public:
  InputError(const std::string& source, const std::string& field, const std::string& got, const std::string& expected)
      : std::runtime_error(source + ": " + field + ": got " + got + ", expected " + expected),
        source_(source),
        field_(field),
        got_(got),
        expected_(expected) {}

  const std::string& source() const noexcept { return source_; }
  const std::string& field() const noexcept { return field_; }
  const std::string& got() const noexcept { return got_; }
  const std::string& expected() const noexcept { return expected_; }

 private:
  std::string source_, field_, got_, expected_;
};

/// The plant could not be integrated or reached a configuration where it is not defined (exit code 6).
class PlantError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// No transport (exit code 5).
class TransportError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace quasilpv
