// Named columns and exact CSV.
#include "quasilpv/record.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

TEST(Record, csv_heads_single_columns_by_name_and_joint_columns_by_index) {
  Record record;
  const auto time = record.add_column("time_s");
  const auto angle = record.add_column("angle_rad", 2);
  record.append(time, 0.0);
  record.append(angle, {0.5, -0.25, 99.0});
  record.append(time, 0.001);
  record.append(angle, {1.0, 2.0});
  std::ostringstream out;
  CsvWriter csv(out);
  record.write_csv(csv);
  EXPECT_TRUE(out.good());
  EXPECT_EQ(out.str(), "time_s,angle_rad_0,angle_rad_1\n0,0.5,-0.25\n0.001,1,2\n");
}

TEST(Record, csv_numbers_read_back_as_the_same_doubles) {
  const std::vector<double> values{0.1,
                                   1.0 / 3.0,
                                   -2.2250738585072014e-308,
                                   std::numeric_limits<double>::denorm_min(),
                                   -std::numeric_limits<double>::max(),
                                   123456789.123456789,
                                   5e-324};
  Record record;
  const auto column = record.add_column("x");
  for (const double value : values) {
    record.append(column, value);
  }
  std::stringstream file;
  CsvWriter csv(file);
  record.write_csv(csv);
  std::string line;
  std::getline(file, line);
  for (const double value : values) {
    std::getline(file, line);
    EXPECT_EQ(std::strtod(line.c_str(), nullptr), value);
  }
}

TEST(Record, columns_are_row_major_and_found_by_name) {
  Record record;
  const auto angle = record.add_column("angle_rad", 2);
  record.append(angle, {1.0, 2.0});
  record.append(angle, {3.0, 4.0});
  EXPECT_EQ(record["angle_rad"].samples(), 2u);
  EXPECT_EQ(record["angle_rad"].values, (std::vector<double>{1.0, 2.0, 3.0, 4.0}));
  EXPECT_THROW(record["speed_rad_s"], InputError);
}

TEST(Record, when_columns_differ_in_length_expect_refusal_naming_the_column) {
  Record record;
  record.append(record.add_column("time_s"), 0.0);
  record.add_column("angle_rad", 2);
  std::ostringstream out;
  CsvWriter csv(out);
  try {
    record.write_csv(csv);
    FAIL() << "written";
  } catch (const InputError& error) {
    EXPECT_EQ(error.field(), "angle_rad");
  }
}

TEST(Record, when_a_column_is_added_twice_or_without_width_expect_refusal) {
  Record record;
  record.add_column("time_s");
  EXPECT_THROW(record.add_column("time_s"), InputError);
  EXPECT_THROW(record.add_column("empty", 0), InputError);
}

}  // namespace
}  // namespace quasilpv
