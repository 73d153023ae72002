// The one writer of files: beside their place, which they take once they are written.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace quasilpv {

/// A new file that takes its place when it is published, or never: until then the place keeps what it has. Only regular
/// files are replaced, links are followed to the file they name, which keeps its mode and its owner. While this lives,
/// no other program of ours writes to the same place. RT-UNSAFE.
class OutputFile {
 public:
  /// Claims the place and makes the new file beside it, under a name of its own. INIT-ONLY.
  ///
  /// Throws InputError with the name of `field` if the place is a device, a pipe, a folder or one of `inputs`, if
  /// another program writes there, or if nothing can be written there.
  ///
  /// @param path     the place
  /// @param field    what is written, for error messages
  /// @param program  who writes, for others that find the place claimed
  /// @param inputs   paths of what this program reads; empty ones are none
  OutputFile(const std::string& path, const std::string& field, const std::string& program,
             const std::vector<std::string>& inputs);
  /// Removes the new file, unless it was published, and gives the place back.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  std::ostream& stream() { return stream_; }

  /// Lets the new file take its place, as far as it could be written: if anything was lost it ends after its last whole
  /// line, and without one the place keeps what it has. Returns whether nothing was lost. Once.
  bool publish();

 private:
  void require_regular(const std::vector<std::string>& inputs) const;
  void claim(const std::string& program);
  void open_new();
  void give_back() noexcept;
  bool cut_to_whole_lines() const;
  [[noreturn]] void fail(const std::string& got) const;

  std::string path_, field_;
  std::filesystem::path place_, lock_, new_;
  int lock_descriptor_ = -1, descriptor_ = -1;
  std::ofstream stream_;
};

}  // namespace quasilpv
