// What both executables print at the end of a run.
#pragma once

#include <nlohmann/json.hpp>
#include <ostream>

#include "quasilpv/exit_codes.hpp"
#include "quasilpv/failsafe.hpp"
#include "quasilpv/latency_histogram.hpp"
#include "quasilpv/link.hpp"
#include "quasilpv/post_mortem.hpp"
#include "quasilpv/system_artifact.hpp"
#include "quasilpv/system_sample.hpp"

namespace quasilpv {

using Json = nlohmann::json;

/// `{count, p50, p99, p99_9, max}` in ns; null where there is nothing to say. RT-UNSAFE, as all here.
Json to_json(const LatencyHistogram& histogram);

/// One member per counter.
Json to_json(const LinkCounters& counters);

/// `{cause, seq: [...], state: [...], ..., torque_nm: [[...] per sample]}` of the samples before a fault, null without
/// one.
Json to_json(const PostMortem& post_mortem, FaultCause cause, int joints);

/// The same of a general system: `{cause, seq, ..., measured: {NAME: [...], ...}, ...}`.
Json to_json(const LastSamples<SystemSample>& post_mortem, FaultCause cause, const SystemArtifact& artifact);

/// One line of JSON, or a table of two columns: path of the member, value.
void print_report(std::ostream& out, const Json& report, bool as_json);

}  // namespace quasilpv
