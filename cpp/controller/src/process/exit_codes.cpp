#include "quasilpv/exit_codes.hpp"

#include <map>

namespace quasilpv {

std::string describe_exit_codes(std::initializer_list<ExitCode> more) {
  static const std::map<ExitCode, const char*> kMeanings = {
      {kExitDone, "done"},
      {kExitNo, "does not hold the rate"},
      {kExitBadInput, "bad input, or an output that cannot be written"},
      {kExitFaultStop, "fault stop"},
      {kExitNoRealtime, "no real-time privilege"},
      {kExitNoTransport, "no transport"},
      {kExitPlantFailure, "plant failure"},
      {kExitInternal, "internal error"},
      {kExitReaderLeft, "the reader of the report left"}};
  std::map<ExitCode, const char*> listed;
  for (const ExitCode code : {kExitDone, kExitBadInput, kExitInternal, kExitReaderLeft}) {
    listed.emplace(code, kMeanings.at(code));
  }
  for (const ExitCode code : more) {
    listed.emplace(code, kMeanings.at(code));
  }
  std::string text = "Exit codes:";
  for (const auto& [code, meaning] : listed) {
    text += (code == kExitDone ? " " : "; ") + std::to_string(static_cast<int>(code)) + " " + meaning;
  }
  return text + ".";
}

}  // namespace quasilpv
