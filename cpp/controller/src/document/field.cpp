// The cursor of strict loading: every refusal names the source, the path of the field, what was found and expected.
#include "document/field.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "document/document.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

constexpr std::size_t kMaxShown = 40;

// A short one-line rendering of a value for an error message.
std::string shown(const Json& value) {
  if (value.is_object()) {
    return "an object";
  }
  if (value.is_array()) {
    return "an array of " + std::to_string(value.size());
  }
  if (value.is_string()) {
    const std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
    return text.size() <= kMaxShown ? text : text.substr(0, kMaxShown) + "...";
  }
  return value.dump();
}

}  // namespace

void Field::fail(const std::string& got, const std::string& expected) const {
  throw InputError(source_, path_.empty() ? "document" : path_, got, expected);
}

void Field::fail_choice(const std::vector<std::string>& names) const {
  std::string choice;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const char* const joint = i == 0 ? "" : i + 1 == names.size() ? " or " : ", ";
    choice.append(joint).append("\"" + names[i] + "\"");
  }
  fail(shown(*value_), choice);
}

Field Field::operator[](const std::string& key) const {
  const std::string path = path_.empty() ? key : path_ + "." + key;
  if (!value_->is_object()) {
    fail(shown(*value_), "an object");
  }
  const auto member = value_->find(key);
  if (member == value_->end()) {
    throw InputError(source_, path, "nothing", "this member");
  }
  return {*member, source_, path};
}

Field Field::at(std::size_t index) const {
  if (index >= size()) {
    fail("an array of " + std::to_string(size()), "more than " + std::to_string(index) + " elements");
  }
  return {(*value_)[index], source_, path_ + "[" + std::to_string(index) + "]"};
}

void Field::only(const std::vector<std::string>& allowed) const {
  if (!value_->is_object()) {
    fail(shown(*value_), "an object");
  }
  for (const auto& [key, member] : value_->items()) {
    if (std::find(allowed.begin(), allowed.end(), key) == allowed.end()) {
      std::string names;
      for (const std::string& name : allowed) {
        names += (names.empty() ? "" : ", ") + name;
      }
      fail("the unknown member " + shown(Json(key)), names.empty() ? "no members" : "only " + names);
    }
  }
}

bool Field::has(const std::string& key) const { return value_->is_object() && value_->contains(key); }

bool Field::is_null() const { return value_->is_null(); }

std::size_t Field::size() const {
  if (!value_->is_array()) {
    fail(shown(*value_), "an array");
  }
  return value_->size();
}

double Field::within(double low, double high, const std::string& expected) const {
  const double value = value_->is_number() ? value_->get<double>() : std::nan("");
  if (!(low <= value && value <= high)) {
    fail(shown(*value_), expected);
  }
  return value;
}

double Field::number(double largest) const {
  return within(-largest, largest, "a finite number of at most " + canonical_number(largest) + " in magnitude");
}

double Field::positive(double smallest, double largest) const {
  return within(smallest, largest,
                "a number > 0, from " + canonical_number(smallest) + " to " + canonical_number(largest));
}

double Field::non_negative(double largest) const {
  return within(0.0, largest, "a number >= 0 of at most " + canonical_number(largest));
}

std::int64_t Field::integer(std::int64_t low, std::int64_t high) const {
  const double value = value_->is_number() ? value_->get<double>() : std::nan("");
  const bool whole = value == std::floor(value);  // false for NaN
  if (!whole || value < static_cast<double>(low) || value > static_cast<double>(high)) {
    fail(shown(*value_), "an integer in [" + std::to_string(low) + ", " + std::to_string(high) + "]");
  }
  return static_cast<std::int64_t>(value);
}

bool Field::boolean() const {
  if (!value_->is_boolean()) {
    fail(shown(*value_), "true or false");
  }
  return value_->get<bool>();
}

std::string Field::text() const {
  if (!value_->is_string()) {
    fail(shown(*value_), "a string");
  }
  return value_->get<std::string>();
}

std::vector<double> Field::numbers(std::size_t expected_size, double largest) const {
  if (!value_->is_array() || value_->size() != expected_size) {
    fail(shown(*value_), "an array of " + std::to_string(expected_size) + " numbers");
  }
  std::vector<double> values(expected_size);
  for (std::size_t i = 0; i < expected_size; ++i) {
    values[i] = at(i).number(largest);
  }
  return values;
}

void Field::expect_text(const std::string& expected) const {
  if (text() != expected) {
    fail(shown(*value_), Json(expected).dump());
  }
}

}  // namespace quasilpv
