// Rows of exact numbers into a stream, one after the other.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>

namespace quasilpv {

/// Writes CSV row by row; numbers are the shortest decimals that read back as the same value, so equal runs give
/// equal files. A full disk is an outcome, not an exception. RT-UNSAFE.
class CsvWriter {
 public:
  /// Writes to a stream that outlives this.
  explicit CsvWriter(std::ostream& out) : out_(out) {}
  CsvWriter(const CsvWriter&) = delete;
  CsvWriter& operator=(const CsvWriter&) = delete;

  /// Heads `width` columns: `name`, or `name_0`, `name_1`, ... if width is above 1.
  void head(const std::string& name, int width = 1);

  void add(double value);
  void add(std::int64_t value);
  void add(const double* values, int count);

  /// Ends the header or a row. Returns false if it, or an earlier one, could not be written.
  bool end_row();

 private:
  void separate();

  std::ostream& out_;
  std::string row_;
};

}  // namespace quasilpv
