#include "quasilpv/csv_writer.hpp"

#include <array>
#include <charconv>

namespace quasilpv {
namespace {

template <class Number>
void append_number(std::string& row, Number value) {
  std::array<char, 32> digits{};  // the longest shortest double has 24 characters, the longest integer 20
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  static_cast<void>(error);
  row.append(digits.data(), end);
}

std::string quoted_if_needed(const std::string& name) {
  if (name.find_first_of(",\"\r\n") == std::string::npos) {
    return name;
  }
  std::string quoted = "\"";
  for (const char character : name) {
    quoted += character == '"' ? "\"\"" : std::string(1, character);
  }
  return quoted + "\"";
}

}  // namespace

void CsvWriter::head(const std::string& name, int width) {
  for (int i = 0; i < width; ++i) {
    separate();
    row_ += quoted_if_needed(width > 1 ? name + "_" + std::to_string(i) : name);
  }
}

void CsvWriter::add(double value) {
  separate();
  append_number(row_, value);
}

void CsvWriter::add(std::int64_t value) {
  separate();
  append_number(row_, value);
}

void CsvWriter::add(const double* values, int count) {
  for (int i = 0; i < count; ++i) {
    add(values[i]);
  }
}

bool CsvWriter::end_row() {
  row_ += '\n';
  out_.write(row_.data(), static_cast<std::streamsize>(row_.size()));
  row_.clear();
  return out_.good();
}

void CsvWriter::separate() {
  if (!row_.empty()) {
    row_ += ',';
  }
}

}  // namespace quasilpv
