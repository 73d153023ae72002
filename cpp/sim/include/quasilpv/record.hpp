// The samples of a run as named columns, and their exact CSV.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "quasilpv/csv_writer.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {

/// Named columns of doubles. A column has a fixed width (values per sample: 1, or one per joint) and is stored
/// row-major, shape [samples x width]. Every column gets one append() per sample.
class Record {
 public:
  struct Column {
    std::string name;
    std::size_t width;
    std::vector<double> values;  ///< [samples x width], row-major

    std::size_t samples() const noexcept { return values.size() / width; }
  };

  /// Returns the column's index. INIT-ONLY. Throws InputError if the name is taken or the width is 0.
  std::size_t add_column(const std::string& name, std::size_t width = 1);

  /// Room for `samples` samples in every column. INIT-ONLY.
  void reserve(std::size_t samples);

  /// Next sample of a column of width 1, or of the width of `value`'s leading joints. RT-UNSAFE (may allocate).
  void append(std::size_t column, double value) { columns_[column].values.push_back(value); }
  void append(std::size_t column, const JointArray& value) { append(column, value.data()); }
  void append(std::size_t column, const double* values);  ///< as many as the column is wide

  const std::vector<Column>& columns() const noexcept { return columns_; }

  /// Throws InputError if there is no such column.
  const Column& operator[](const std::string& name) const;

  /// One header line, then one line per sample. A column of width 1 is headed by its name, the entries of a wider one
  /// by `name_0`, `name_1`, ... Whether all of it could be written, the writer knows. Throws InputError if the columns
  /// differ in length.
  void write_csv(CsvWriter& csv) const;

 private:
  std::vector<Column> columns_;
};

}  // namespace quasilpv
