// Numbers of command lines: decimal, finite, bounded, or one line that says what was expected.
#include "quasilpv/decimal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "quasilpv/errors.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {
namespace {

using ::testing::HasSubstr;

std::string refusal(const std::string& text, double low = -10.0, double high = 10.0) {
  try {
    parse_number(text, "command line", "x", low, high);
    return "accepted";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(Decimal, reads_what_json_would_write) {
  EXPECT_EQ(parse_number("0.02", "", "", 0.0, 1.0), 0.02);
  EXPECT_EQ(parse_number("-1e-3", "", "", -1.0, 1.0), -1e-3);
  EXPECT_EQ(parse_number("10", "", "", 0.0, 10.0), 10.0);
  EXPECT_EQ(parse_integer("9223372036854775807", "", "", 0, std::numeric_limits<std::int64_t>::max()),
            std::numeric_limits<std::int64_t>::max());
}

TEST(Decimal, refuses_everything_else_on_one_line) {
  for (const char* text : {"",   " ",  "nan", "NAN", "inf", "-inf", "infinity", "1e400", "0x10", "+1", "1,5",
                           "1 ", " 1", "1e",  ".",   "-",   "1\n2", "10.1",     "-10.1", "1d",   "١"}) {
    const std::string line = refusal(text);
    EXPECT_THAT(line, HasSubstr("x: got \"")) << text;
    EXPECT_THAT(line, HasSubstr("expected a number from -10 to 10")) << text;
    EXPECT_EQ(line.find('\n'), std::string::npos) << text;
  }
  for (const char* text : {"", "1.0", "1e3", "0x1", "+1", "9223372036854775808", "-9223372036854775809", " 1"}) {
    EXPECT_THROW(parse_integer(text, "", "", -1000, 1000), InputError) << text;
  }
}

TEST(Decimal, shows_long_texts_and_control_characters_on_one_short_line) {
  EXPECT_EQ(on_one_line("a\tb\nc\x1b[0m\x7f"), "a\\tb\\nc\\x1b[0m\\x7f");
  EXPECT_LT(refusal(std::string(100'000, '9')).size(), 200u);
}

TEST(Decimal, seconds_that_are_no_time_become_one_that_fits) {
  EXPECT_EQ(to_nanoseconds(std::nan("")), 0);
  const std::int64_t longest = to_nanoseconds(std::numeric_limits<double>::infinity());
  EXPECT_EQ(longest, to_nanoseconds(1e300));
  EXPECT_EQ(-longest, to_nanoseconds(-1e300));
  EXPECT_GT(longest, std::int64_t{100} * 365 * 86400 * kNanosecondsPerSecond);
  EXPECT_LE(longest, std::numeric_limits<std::int64_t>::max() / 2);
  EXPECT_EQ(to_nanoseconds(0.02), 20'000'000);
}

}  // namespace
}  // namespace quasilpv
