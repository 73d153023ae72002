#include "quasilpv/system_disturbance.hpp"

#include <algorithm>
#include <cmath>

namespace quasilpv {

SystemDisturbance::SystemDisturbance(const std::vector<DisturbanceTerm>& terms) {
  for (const DisturbanceTerm& term : terms) {
    sources_.push_back({term, GaussianNoise(term.seed), term.size});
  }
}

void SystemDisturbance::draw() {
  for (Source& source : sources_) {
    if (source.term.kind == DisturbanceTerm::Kind::kNoise) {
      source.held = source.term.size * source.noise();
    }
  }
}

void SystemDisturbance::begin(double time_s) noexcept {
  const double now_s = time_s + kShortestInterval;
  for (Source& source : sources_) {
    source.acts = source.term.begin_s <= now_s && now_s < source.term.end_s;
  }
}

double SystemDisturbance::next_edge(double from_s, double to_s) const noexcept {
  double edge_s = to_s;
  for (const Source& source : sources_) {
    for (const double time_s : {source.term.begin_s, source.term.end_s}) {
      if (time_s > from_s + kShortestInterval && time_s < to_s - kShortestInterval) {
        edge_s = std::min(edge_s, time_s);
      }
    }
  }
  return edge_s;
}

void SystemDisturbance::add(double time_s, double* signals) const noexcept {
  for (const Source& source : sources_) {
    if (!source.acts) {
      continue;
    }
    const DisturbanceTerm& term = source.term;
    signals[term.signal] += term.kind == DisturbanceTerm::Kind::kSine
                                ? term.size * std::sin(term.frequency_rad_s * time_s + term.phase_rad)
                                : source.held;
  }
}

}  // namespace quasilpv
