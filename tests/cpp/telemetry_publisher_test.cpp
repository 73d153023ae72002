#include "quasilpv/telemetry_publisher.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "quasilpv/in_process_link.hpp"

namespace quasilpv {
namespace {

constexpr double kPeriod = 1e-3;

TelemetrySample sample(std::int64_t seq, double angle = 0.0) {
  TelemetrySample telemetry;
  telemetry.seq = seq;
  telemetry.measured_angle_rad[1] = angle;
  return telemetry;
}

std::vector<std::string> fields(const std::string& line) {
  std::vector<std::string> result;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');) {
    result.push_back(field);
  }
  return result;
}

std::unique_ptr<OutputFile> record_at(const std::string& path) {
  return std::make_unique<OutputFile>(path, "record", "telemetry_publisher_test", std::vector<std::string>{});
}

/// While it lives, no file of this process grows beyond a size, as on a disk that is full.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : signal_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, signal_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
  void (*signal_)(int);
};

TEST(TelemetryPublisher, records_every_sample_in_order_with_numbers_that_read_back_as_they_were) {
  const std::string path = (std::filesystem::temp_directory_path() / "telemetry_publisher_test.csv").string();
  const std::vector<double> angles = {0.1, 1.0 / 3.0, -5e-324, 1e308, std::numeric_limits<double>::epsilon()};
  TelemetryPublisher publisher(nullptr, kPeriod, 2, record_at(path));
  for (std::size_t k = 0; k < angles.size(); ++k) {
    ASSERT_TRUE(publisher.ring().push(sample(static_cast<std::int64_t>(k), angles[k])));
  }
  EXPECT_EQ(publisher.stop().record_drops, 0);

  std::ifstream file(path);
  std::string line;
  ASSERT_TRUE(std::getline(file, line));
  const std::vector<std::string> header = fields(line);
  const auto column = std::find(header.begin(), header.end(), "measured_angle_rad_1") - header.begin();
  ASSERT_LT(static_cast<std::size_t>(column), header.size());
  for (std::size_t k = 0; k < angles.size(); ++k) {
    ASSERT_TRUE(std::getline(file, line));
    const std::vector<std::string> row = fields(line);
    ASSERT_EQ(row.size(), header.size());
    EXPECT_EQ(row[0], std::to_string(k));
    EXPECT_EQ(std::strtod(row[static_cast<std::size_t>(column)].c_str(), nullptr), angles[k]);
  }
  EXPECT_FALSE(std::getline(file, line));
  std::filesystem::remove(path);
}

TEST(TelemetryPublisher, F15_when_the_disk_is_full_expect_lost_rows_counted_and_no_other_harm) {
  const std::string path = (std::filesystem::temp_directory_path() / "telemetry_publisher_full_test.csv").string();
  const FileSizeLimit limit(4096);
  TelemetryPublisher publisher(nullptr, kPeriod, 3, record_at(path));
  for (std::int64_t seq = 0; seq < 1000; ++seq) {
    ASSERT_TRUE(publisher.ring().push(sample(seq)));
  }
  const TelemetryReport report = publisher.stop();
  EXPECT_GT(report.record_drops, 0);
  EXPECT_EQ(report.drops, 0);
  EXPECT_LE(std::filesystem::file_size(path), 4096u);
  std::filesystem::remove(path);
}

TEST(TelemetryPublisher, F15_when_more_arrives_than_the_ring_holds_expect_published_and_dropped_to_add_up) {
  constexpr std::int64_t kSamples = 50'000;
  TelemetryPublisher publisher(std::move(InProcessLink::create_pair({1, 2, 3}).first), kPeriod, 3, nullptr);
  for (std::int64_t seq = 0; seq < kSamples; ++seq) {
    publisher.ring().push(sample(seq));
  }
  const TelemetryReport report = publisher.stop();
  EXPECT_EQ(report.published + report.drops, kSamples);
  EXPECT_GE(report.published, static_cast<std::int64_t>(TelemetryPublisher::Ring::capacity()));
}

}  // namespace
}  // namespace quasilpv
