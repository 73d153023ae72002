#include "quasilpv/record.hpp"

#include <array>
#include <charconv>
#include <ostream>

#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

void write_header(std::ostream& out, const std::vector<Record::Column>& columns) {
  const char* separator = "";
  for (const Record::Column& column : columns) {
    for (std::size_t i = 0; i < column.width; ++i) {
      out << separator << column.name;
      if (column.width > 1) {
        out << '_' << i;
      }
      separator = ",";
    }
  }
  out << '\n';
}

void write_sample(std::ostream& out, const std::vector<Record::Column>& columns, std::size_t sample) {
  std::array<char, 32> digits{};
  const char* separator = "";
  for (const Record::Column& column : columns) {
    for (std::size_t i = 0; i < column.width; ++i) {
      const double value = column.values[sample * column.width + i];
      const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
      static_cast<void>(error);  // the longest shortest double has 24 characters
      out << separator;
      out.write(digits.data(), end - digits.data());
      separator = ",";
    }
  }
  out << '\n';
}

}  // namespace

std::size_t Record::add_column(const std::string& name, std::size_t width) {
  for (const Column& column : columns_) {
    if (column.name == name) {
      throw InputError("record", name, "a second column of that name", "one");
    }
  }
  if (width == 0) {
    throw InputError("record", name, "width 0", "at least 1 value per sample");
  }
  columns_.push_back({name, width, {}});
  return columns_.size() - 1;
}

void Record::reserve(std::size_t samples) {
  for (Column& column : columns_) {
    column.values.reserve(samples * column.width);
  }
}

void Record::append(std::size_t column, const JointArray& value) {
  Column& target = columns_[column];
  target.values.insert(target.values.end(), value.begin(), value.begin() + static_cast<std::ptrdiff_t>(target.width));
}

const Record::Column& Record::operator[](const std::string& name) const {
  for (const Column& column : columns_) {
    if (column.name == name) {
      return column;
    }
  }
  throw InputError("record", name, "no such column", "one that was added");
}

void Record::write_csv(std::ostream& out) const {
  const std::size_t samples = columns_.empty() ? 0 : columns_.front().samples();
  for (const Column& column : columns_) {
    if (column.values.size() != samples * column.width) {
      throw InputError("record", column.name, std::to_string(column.values.size()) + " values",
                       std::to_string(samples * column.width));
    }
  }
  write_header(out, columns_);
  for (std::size_t sample = 0; sample < samples; ++sample) {
    write_sample(out, columns_, sample);
  }
}

}  // namespace quasilpv
