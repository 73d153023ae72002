// Rows of exact numbers into a file, one after the other.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>

namespace quasilpv {

/// Writes a CSV file row by row; numbers are the shortest decimals that read back as the same value, so equal runs give
/// equal files. A full disk is an outcome, not an exception. RT-UNSAFE.
class CsvWriter {
 public:
  /// Throws InputError if the file cannot be created.
  explicit CsvWriter(const std::string& path);

  /// Heads `width` columns: `name`, or `name_0`, `name_1`, ... if width is above 1.
  void head(const std::string& name, int width = 1);

  void add(double value);
  void add(std::int64_t value);
  void add(const double* values, int count);

  /// Ends the header or a row. Returns false if it, or an earlier one, could not be written.
  bool end_row();

  /// Flushes and closes; false if anything was lost.
  bool close();

 private:
  void separate();

  std::ofstream file_;
  std::string row_;
};

}  // namespace quasilpv
