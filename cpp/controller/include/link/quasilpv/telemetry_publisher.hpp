// Telemetry leaves the control thread through a ring and the process through this thread.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "quasilpv/csv_writer.hpp"
#include "quasilpv/link.hpp"
#include "quasilpv/output_file.hpp"
#include "quasilpv/system_artifact.hpp"
#include "quasilpv/telemetry_ring.hpp"

namespace quasilpv {

/// What became of the telemetry of a run.
struct TelemetryReport {
  std::int64_t published = 0;
  std::int64_t send_failures = 0;
  std::int64_t drops = 0;         ///< the ring was full
  std::int64_t record_drops = 0;  ///< rows the record lost, for example to a full disk
};

/// How a sample is written as a row: its columns behind `seq` and `time_s`.
template <class Sample>
struct SampleColumns {
  std::function<void(CsvWriter&)> head;
  std::function<void(CsvWriter&, const Sample&)> row;
};

/// Publishes telemetry on a link of its own and records it as CSV if asked. The control thread touches only ring(). One
/// thread calls the members, the control thread pushes.
template <class Sample>
class SamplePublisher {
 public:
  using Ring = TelemetryRing<Sample, 4096>;

  /// Starts the thread, which runs at normal priority. INIT-ONLY.
  ///
  /// @param link    where to publish; may be null
  /// @param record  CSV file; may be null. It takes its place if it has a row at the end.
  SamplePublisher(std::unique_ptr<Link> link, double sample_period_s, SampleColumns<Sample> columns,
                  std::unique_ptr<OutputFile> record);
  ~SamplePublisher();
  SamplePublisher(const SamplePublisher&) = delete;
  SamplePublisher& operator=(const SamplePublisher&) = delete;

  Ring& ring() noexcept { return *ring_; }

  /// Publishes and records what is left, lets the record take its place and ends the thread. Call after the last push.
  TelemetryReport stop();

 private:
  void run();
  void drain();
  void write_row(const Sample& sample);

  std::unique_ptr<Link> link_;
  double sample_period_s_;
  SampleColumns<Sample> columns_;
  std::unique_ptr<OutputFile> record_;
  std::unique_ptr<CsvWriter> csv_;
  std::int64_t rows_ = 0;
  std::unique_ptr<Ring> ring_;
  TelemetryReport report_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

/// That of a robot. Columns: `seq`, `time_s`, then as in the in-process record `measured_angle_rad_0` ...
/// `integral_error_rad_s_*`, `flags`, then `state` and `step_ns`; a single joint has columns without an index.
class TelemetryPublisher : public SamplePublisher<TelemetrySample> {
 public:
  TelemetryPublisher(std::unique_ptr<Link> link, double sample_period_s, int joints,
                     std::unique_ptr<OutputFile> record);
};

/// That of a general system. Columns: `seq`, `time_s`, `measured.NAME` of every state, `commanded.NAME` and
/// `applied.NAME` of every input, `premise`, `level`, `flags`, `state`, `step_ns`.
class SystemPublisher : public SamplePublisher<SystemSample> {
 public:
  SystemPublisher(std::unique_ptr<Link> link, const SystemArtifact& artifact, std::unique_ptr<OutputFile> record);
};

}  // namespace quasilpv
