#include "command_line/run_report.hpp"

#include <algorithm>
#include <iomanip>
#include <string>
#include <utility>
#include <vector>

namespace quasilpv {
namespace {

using Rows = std::vector<std::pair<std::string, std::string>>;

void flatten(const Json& value, const std::string& path, Rows& rows) {
  if (!value.is_object()) {
    rows.emplace_back(path, value.is_string() ? value.get<std::string>() : value.dump());
    return;
  }
  for (const auto& [name, member] : value.items()) {
    std::string member_path = path;
    member_path.append(path.empty() ? "" : ".").append(name);
    flatten(member, member_path, rows);
  }
}

/// What the samples before a fault have in common, and what `add` says of each.
template <class Sample, class Add>
Json columns_of(const LastSamples<Sample>& post_mortem, FaultCause cause, Add add) {
  if (post_mortem.size() == 0 || cause == FaultCause::kStopRequested) {
    return nullptr;
  }
  Json report = {{"cause", to_string(cause)}};
  for (std::size_t i = 0; i < post_mortem.size(); ++i) {
    const Sample& sample = post_mortem[i];
    report["seq"].push_back(sample.seq);
    report["state"].push_back(static_cast<int>(sample.state));
    report["flags"].push_back(sample.flags);
    report["step_ns"].push_back(sample.step_ns);
    add(sample, report);
  }
  return report;
}

}  // namespace

Json to_json(const LatencyHistogram& histogram) {
  if (histogram.count() == 0) {
    return nullptr;
  }
  return {{"count", histogram.count()},
          {"p50", histogram.quantile_ns(0.5)},
          {"p99", histogram.quantile_ns(0.99)},
          {"p99_9", histogram.quantile_ns(0.999)},
          {"max", histogram.max_ns()}};
}

Json to_json(const LinkCounters& counters) {
  return {{"accepted", counters.accepted},
          {"duplicates", counters.duplicates},
          {"old", counters.old},
          {"superseded", counters.superseded},
          {"not_authentic", counters.not_authentic},
          {"wrong_length", counters.wrong_length},
          {"wrong_checksum", counters.wrong_checksum},
          {"wrong_type", counters.wrong_type},
          {"wrong_session", counters.wrong_session},
          {"wrong_artifact", counters.wrong_artifact},
          {"out_of_bounds", counters.out_of_bounds},
          {"second_sender", counters.second_sender},
          {"other_mode", counters.other_mode},
          {"unfit_events", counters.unfit_events},
          {"lost_events", counters.lost_events},
          {"send_failures", counters.send_failures}};
}

Json to_json(const PostMortem& post_mortem, FaultCause cause, int joints) {
  using Values = JointArray TelemetrySample::*;
  static const std::pair<const char*, Values> kColumns[] = {
      {"reference_angle_rad", &TelemetrySample::reference_angle_rad},
      {"measured_angle_rad", &TelemetrySample::measured_angle_rad},
      {"estimated_angle_rad", &TelemetrySample::estimated_angle_rad},
      {"estimated_speed_rad_s", &TelemetrySample::estimated_speed_rad_s},
      {"torque_commanded_nm", &TelemetrySample::commanded_torque_nm},
      {"torque_applied_nm", &TelemetrySample::applied_torque_nm}};
  return columns_of(post_mortem, cause, [joints](const TelemetrySample& sample, Json& report) {
    for (const auto& [name, values] : kColumns) {
      report[name].push_back(std::vector<double>((sample.*values).begin(), (sample.*values).begin() + joints));
    }
  });
}

Json to_json(const LastSamples<SystemSample>& post_mortem, FaultCause cause, const SystemArtifact& artifact) {
  return columns_of(post_mortem, cause, [&artifact](const SystemSample& sample, Json& report) {
    for (std::size_t k = 0; k < artifact.states().size(); ++k) {
      report["measured"][artifact.states()[k].name].push_back(sample.measured[k]);
    }
    for (std::size_t k = 0; k < artifact.inputs().size(); ++k) {
      report["commanded"][artifact.inputs()[k].name].push_back(sample.commanded[k]);
      report["applied"][artifact.inputs()[k].name].push_back(sample.applied[k]);
    }
    report["level"].push_back(sample.level);
  });
}

void print_report(std::ostream& out, const Json& report, bool as_json) {
  if (as_json) {
    out << report.dump() << '\n';
    return;
  }
  Rows rows;
  flatten(report, "", rows);
  std::size_t width = 0;
  for (const auto& [path, value] : rows) {
    width = std::max(width, path.size());
  }
  for (const auto& [path, value] : rows) {
    out << std::left << std::setw(static_cast<int>(width) + 2) << path << value << '\n';
  }
}

}  // namespace quasilpv
