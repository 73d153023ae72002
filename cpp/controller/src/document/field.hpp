// A cursor into a parsed document: strict reading, member by member.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

namespace quasilpv {

using Json = nlohmann::json;

/// No number that is read from a document is larger, and no positive one smaller than its reciprocal: products of a few
/// of them are finite.
inline constexpr double kLargestReadNumber = 1e100;

/// A value of a document that knows its path: every error names the field, what was found and what was expected.
/// INIT-ONLY. All members throw InputError.
class Field {
 public:
  Field(const Json& value, std::string source, std::string path)
      : value_(&value), source_(std::move(source)), path_(std::move(path)) {}

  const Json& json() const { return *value_; }
  const std::string& source() const { return source_; }
  const std::string& path() const { return path_; }
  [[noreturn]] void fail(const std::string& got, const std::string& expected) const;
  /// Expected was one of these names.
  [[noreturn]] void fail_choice(const std::vector<std::string>& names) const;

  /// Member of an object; missing is an error.
  Field operator[](const std::string& key) const;
  /// Element of an array.
  Field at(std::size_t index) const;
  /// Refuses an object with members other than `allowed`.
  void only(const std::vector<std::string>& allowed) const;
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
