// write_corpus FOLDER: the seeds of the fuzzers, one artifact of every law and one message of every type.
#include <filesystem>
#include <fstream>
#include <string>

#include "../cpp/artifact_fixture.hpp"
#include "quasilpv/messages.hpp"

namespace {

using namespace quasilpv;           // NOLINT(google-build-using-namespace): this file is the program
using namespace quasilpv::testing;  // NOLINT(google-build-using-namespace)

void write(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << bytes;
}

template <class Message>
void fill(Message& message) {
  message.joints = 3;
}
void fill(event_v2& message) {
  message.source = static_cast<std::int32_t>(Side::kController);
  message.code = static_cast<std::int32_t>(EventCode::kStarted);
}
void fill(signals_measurement_v1& message) { message.signals = 6; }
void fill(signals_command_v1& message) { message.inputs = 3; }

template <class Message>
std::string message_seed(char channel) {
  Message message{};
  message.session = 42;
  message.artifact_hash = -7;
  fill(message);
  Packet packet;
  encode(message, packet);
  return channel + std::string(packet.bytes.begin(), packet.bytes.begin() + packet.size);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  const auto write_twins = [&folder](const std::string& name, const Json& artifact) {
    write(folder / "artifact_json" / name, json_twin(artifact));
    write(folder / "artifact_cbor" / name, cbor_twin(artifact));
  };
  for (const char* kind : kLawKinds) {
    write_twins(kind, artifact_table(kind, 1));
  }
  Json watched = artifact_table("dob-acceleration", 1);
  watched["law"]["lyapunov_bound"] = TestArm{1}.lyapunov_bound();
  write_twins("lyapunov-bound", watched);
  write(folder / "message" / "measurement", message_seed<measurement_v3>(0));
  write(folder / "message" / "command", message_seed<command_v2>(1));
  write(folder / "message" / "event", message_seed<event_v2>(2));
  write(folder / "message" / "signals_measurement", message_seed<signals_measurement_v1>(3));
  write(folder / "message" / "signals_command", message_seed<signals_command_v1>(4));
}
