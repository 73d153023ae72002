// The mean of sampled weights over a moving window, and what they were at its beginning.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace quasilpv {

/// A ring of the last N + 1 samples of `size` weights and their mean over the N sample periods between them by the
/// trapezoidal rule, which is exact for weights linear between samples. A sum is updated with the period that enters
/// and the one that leaves. Rounding does not build up: what has entered is summed a second time, from zero, and every
/// N samples, when that is the whole window, it takes the place of the first sum. Weights of a block that sum to a
/// constant keep doing so in the mean.
class MovingWindow {
 public:
  /// \param periods N >= 0; 0: the mean and the beginning are the last sample. INIT-ONLY.
  MovingWindow(int periods, int size)
      : periods_(static_cast<std::size_t>(periods)),
        size_(static_cast<std::size_t>(size)),
        ring_((periods_ + 1) * size_),
        sum_(size_),
        entered_(size_),
        mean_(size_) {}

  /// Fills the window with one sample, as if the past had been constant.
  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  void reset(const double* weight) noexcept {
    for (std::size_t row = 0; row <= periods_; ++row) {
      copy(weight, at(row));
    }
    for (std::size_t i = 0; i < size_; ++i) {
      sum_[i] = static_cast<double>(periods_) * weight[i];
      entered_[i] = 0.0;
      mean_[i] = weight[i];
    }
    newest_ = 0;
    count_ = 0;
  }

  /// Moves the window on by one sample. RT-SAFE (bounded, no allocation, no lock, no throw).
  void push(const double* weight) noexcept {
    const std::size_t previous = newest_;
    newest_ = next(newest_);
    double* const leaving = at(newest_);  // the beginning of the window so far
    if (periods_ == 0) {
      copy(weight, leaving);
      copy(weight, mean_.data());
      return;
    }
    const bool full = ++count_ == periods_;
    const double* const second = at(next(newest_));
    const double* const last = at(previous);
    for (std::size_t i = 0; i < size_; ++i) {
      const double enters = 0.5 * (last[i] + weight[i]);
      entered_[i] += enters;
      sum_[i] = full ? entered_[i] : sum_[i] + enters - 0.5 * (leaving[i] + second[i]);
      mean_[i] = sum_[i] / static_cast<double>(periods_);
      leaving[i] = weight[i];
    }
    if (full) {
      count_ = 0;
      std::fill(entered_.begin(), entered_.end(), 0.0);
    }
  }

  /// Mean over the window, `size` values. RT-SAFE.
  const double* mean() const noexcept { return mean_.data(); }
  /// The sample N periods ago, `size` values. RT-SAFE.
  const double* beginning() const noexcept { return ring_.data() + next(newest_) * size_; }

 private:
  // A loop, not std::copy_n: with a window of one weight known to it, g++ 14 takes the size for one that may be larger
  // and refuses the copy as one beyond the array (-Warray-bounds), which is a false alarm.
  void copy(const double* weight, double* to) const noexcept {
    for (std::size_t i = 0; i < size_; ++i) {
      to[i] = weight[i];
    }
  }
  double* at(std::size_t row) noexcept { return ring_.data() + row * size_; }
  std::size_t next(std::size_t row) const noexcept { return row == periods_ ? 0 : row + 1; }

  std::size_t periods_;
  std::size_t size_;
  std::vector<double> ring_;     // row by row; the row after the newest is the oldest
  std::vector<double> sum_;      // over the window, in sample periods
  std::vector<double> entered_;  // over the `count_` periods since the sum was replaced
  std::vector<double> mean_;
  std::size_t newest_ = 0;
  std::size_t count_ = 0;
};

}  // namespace quasilpv
