// The moving window against sums written out, and against integrals in closed form.
#include "laws/common/moving_window.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace quasilpv {
namespace {

using Row = std::vector<double>;

// What the window stands for, from the whole past: the trapezoidal mean over N periods.
Row direct_mean(const std::vector<Row>& past, std::size_t periods) {
  Row mean(past[0].size(), 0.0);
  for (std::size_t age = 0; age <= periods; ++age) {
    const Row& row = age < past.size() ? past[past.size() - 1 - age] : past[0];
    for (std::size_t i = 0; i < mean.size(); ++i) {
      mean[i] += (age == 0 || age == periods ? 0.5 : 1.0) * row[i] / static_cast<double>(periods);
    }
  }
  return mean;
}

TEST(MovingWindow, is_the_trapezoidal_mean_over_the_window_and_holds_its_beginning) {
  std::mt19937_64 random(71);
  std::uniform_real_distribution<double> weight(0.0, 1.0);
  for (const int periods : {1, 5, 64}) {
    const auto length = static_cast<std::size_t>(periods);
    MovingWindow window(periods, 3);
    std::vector<Row> past = {{weight(random), weight(random), weight(random)}};
    window.reset(past[0].data());
    for (std::size_t k = 1; k < 5 * length + 7; ++k) {
      past.push_back({weight(random), weight(random), weight(random)});
      window.push(past.back().data());
      const Row expected = direct_mean(past, length);
      const Row& beginning = past[k > length ? k - length : 0];
      for (std::size_t i = 0; i < 3; ++i) {
        ASSERT_NEAR(window.mean()[i], expected[i], 1e-14) << periods << " periods, sample " << k;
        ASSERT_EQ(window.beginning()[i], beginning[i]);
      }
    }
  }
}

// (1/tau) int cos = (sin(t) - sin(t - tau)) / tau; the trapezoidal rule is off by at most T^2/12.
TEST(MovingWindow, approaches_the_integral_with_the_square_of_the_sample_period) {
  for (const int periods : {50, 100, 200}) {
    const double T = 0.5 / periods;
    MovingWindow window(periods, 1);
    double first = std::cos(0.0);
    window.reset(&first);
    for (int k = 1; k <= 3 * periods; ++k) {
      const double w = std::cos(k * T);
      window.push(&w);
    }
    const double t = 3 * periods * T;
    EXPECT_NEAR(window.mean()[0], (std::sin(t) - std::sin(t - 0.5)) / 0.5, T * T / 12.0);
  }
}

TEST(MovingWindow, keeps_pair_sums_and_does_not_drift_in_ten_million_samples) {
  MovingWindow window(7, 2);
  double weights[2] = {0.1, 0.4};
  window.reset(weights);
  std::mt19937_64 random(73);
  std::uniform_real_distribution<double> share(0.0, 0.5);
  std::vector<Row> past;
  for (int k = 0; k < 10'000'000; ++k) {
    weights[0] = share(random);
    weights[1] = 0.5 - weights[0];
    window.push(weights);
    if (k >= 10'000'000 - 8) {
      past.push_back({weights[0], weights[1]});
    }
  }
  EXPECT_NEAR(window.mean()[0] + window.mean()[1], 0.5, 1e-15);
  EXPECT_NEAR(window.mean()[0], direct_mean(past, 7)[0], 1e-15);
}

TEST(MovingWindow, of_no_period_is_the_last_sample) {
  MovingWindow window(0, 2);
  const double first[2] = {0.25, 0.75};
  const double second[2] = {0.5, 0.5};
  window.reset(first);
  EXPECT_EQ(window.mean()[1], 0.75);
  window.push(second);
  EXPECT_EQ(window.mean()[0], 0.5);
  EXPECT_EQ(window.beginning()[1], 0.5);
}

}  // namespace
}  // namespace quasilpv
