#include "quasilpv/record.hpp"

#include "quasilpv/csv_writer.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

constexpr std::size_t kMostSamples = 10'000'000;  // a few gigabytes

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
  if (samples > kMostSamples) {
    throw InputError("record", "samples", std::to_string(samples),
                     "at most " + std::to_string(kMostSamples) + ": a shorter run, or none that is recorded");
  }
  for (Column& column : columns_) {
    column.values.reserve(samples * column.width);
  }
}

void Record::append(std::size_t column, const double* values) {
  Column& target = columns_[column];
  target.values.insert(target.values.end(), values, values + target.width);
}

const Record::Column& Record::operator[](const std::string& name) const {
  for (const Column& column : columns_) {
    if (column.name == name) {
      return column;
    }
  }
  throw InputError("record", name, "no such column", "one that was added");
}

void Record::write_csv(CsvWriter& csv) const {
  const std::size_t samples = columns_.empty() ? 0 : columns_.front().samples();
  for (const Column& column : columns_) {
    if (column.values.size() != samples * column.width) {
      throw InputError("record", column.name, std::to_string(column.values.size()) + " values",
                       std::to_string(samples * column.width));
    }
  }
  for (const Column& column : columns_) {
    csv.head(column.name, static_cast<int>(column.width));
  }
  csv.end_row();
  for (std::size_t sample = 0; sample < samples; ++sample) {
    for (const Column& column : columns_) {
      csv.add(column.values.data() + sample * column.width, static_cast<int>(column.width));
    }
    csv.end_row();
  }
}

}  // namespace quasilpv
