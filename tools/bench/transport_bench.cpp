// transport_bench URL SAMPLES: round trips of measurement and command in lock-step, between two processes over LCM and
// between two threads over the in-process link. The controller's side answers at once: nothing but the wire is timed.
#include <sys/wait.h>
#include <unistd.h>

#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "main.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/in_process_link.hpp"
#include "quasilpv/lcm_link.hpp"
#include "quasilpv/realtime.hpp"
#include "timing.hpp"

namespace {

using namespace quasilpv;         // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::bench;  // NOLINT(google-build-using-namespace)

constexpr int kJoints = 3;
constexpr std::int64_t kRepeatAfter = 50 * kNanosecondsPerMillisecond;  // as in docs/reference/messages.md
constexpr std::int64_t kGiveUpAfter = 10 * kNanosecondsPerSecond;
// The first round trips set up routes, pages and branch predictors.
constexpr std::int64_t kWarmUp = 100;

WireIdentity identity() {
  WireIdentity wire;
  wire.session = getpid();
  wire.joints = kJoints;
  return wire;
}

/// The controller's side: one command per measurement, until `last_seq` or silence.
void answer(Link& link, std::int64_t last_seq) {
  measurement_v3 measurement{};
  command_v2 command{};
  std::int64_t deadline = monotonic_ns() + kGiveUpAfter;
  while (monotonic_ns() < deadline) {
    if (link.receive(kRepeatAfter) && link.take(measurement)) {
      command.seq = measurement.seq;
      link.send(command);
      deadline = monotonic_ns() + kGiveUpAfter;
      if (measurement.seq == last_seq) {
        return;
      }
    }
  }
}

/// Sends measurement `seq` until its command arrives; counts what had to be sent again.
void round_trip(Link& link, std::int64_t seq, std::int64_t& repeated) {
  measurement_v3 measurement{};
  measurement.seq = seq;
  command_v2 command{};
  const std::int64_t deadline = monotonic_ns() + kGiveUpAfter;
  link.send(measurement);
  while (true) {
    if (link.receive(kRepeatAfter)) {
      if (link.take(command) && command.seq == seq) {
        return;
      }
    } else if (monotonic_ns() > deadline) {
      throw TransportError("no answer to measurement " + std::to_string(seq) + " within 10 s");
    } else {
      ++repeated;
      link.send(measurement);
    }
  }
}

nlohmann::json ask(Link& link, std::int64_t samples) {
  std::vector<double> durations;
  durations.reserve(static_cast<std::size_t>(samples));
  std::int64_t repeated = 0;
  for (std::int64_t seq = 0; seq < kWarmUp; ++seq) {
    round_trip(link, seq, repeated);
  }
  for (std::int64_t seq = kWarmUp; seq < kWarmUp + samples; ++seq) {
    const std::int64_t start = monotonic_ns();
    round_trip(link, seq, repeated);
    durations.push_back(static_cast<double>(monotonic_ns() - start));
  }
  return {{"p50_ns", quantile(durations, 0.5)},
          {"p99_ns", quantile(durations, 0.99)},
          {"p999_ns", quantile(durations, 0.999)},
          {"repeated", repeated}};
}

nlohmann::json measure_lcm(const std::string& url, std::int64_t samples) {
  const WireIdentity wire = identity();
  const pid_t child = fork();  // before any thread exists
  if (child < 0) {
    throw std::runtime_error("fork failed");
  }
  if (child == 0) {
    try {
      LcmLink controller(Side::kController, wire, url, false);
      answer(controller, kWarmUp + samples - 1);
    } catch (const std::exception& error) {
      std::cerr << error.what() << '\n';
      _exit(2);
    }
    _exit(0);
  }
  LcmLink plant(Side::kPlant, wire, url, false);
  nlohmann::json report = ask(plant, samples);
  waitpid(child, nullptr, 0);
  return report;
}

nlohmann::json measure_in_process(std::int64_t samples) {
  const auto [controller, plant] = InProcessLink::create_pair(identity());
  std::thread other([&link = *controller, samples] { answer(link, kWarmUp + samples - 1); });
  nlohmann::json report;
  try {
    report = ask(*plant, samples);
  } catch (...) {
    other.join();
    throw;
  }
  other.join();
  return report;
}

/// What authenticated mode adds to a message: its tag made by the sender and checked by the receiver.
nlohmann::json measure_authentication(std::int64_t samples) {
  const MessageKey key({1, 2, 3});
  Packet packet;
  encode(measurement_v3{}, packet);
  const auto size = static_cast<std::size_t>(packet.size);
  constexpr int kRounds = 11;
  const auto time = [&](const auto& call) {
    return to_json(time_calls(
        static_cast<std::size_t>(samples), kRounds, [] {}, [&](std::size_t) { keep(call()); }));
  };
  std::uint8_t* tag = packet.bytes.data() + size;
  return {{"bytes", size},
          {"sign", time([&] {
             key.sign(packet.bytes.data(), size, tag);
             return packet.bytes[size];
           })},
          {"check", time([&] { return key.is_authentic(packet.bytes.data(), size, tag); })}};
}

nlohmann::json measure(const std::vector<std::string>& arguments) {
  const std::int64_t samples = count(arguments[1]);
  const nlohmann::json lcm = measure_lcm(arguments[0], samples);
  return {{"samples", samples},
          {"lcm", lcm},
          {"in_process", measure_in_process(samples)},
          {"authentication", measure_authentication(samples)}};
}

}  // namespace

int main(int argc, char** argv) { return run_benchmark(argc, argv, {"URL", "SAMPLES"}, measure); }
