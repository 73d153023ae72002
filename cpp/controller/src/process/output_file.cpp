#include "quasilpv/output_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <random>
#include <string_view>
#include <system_error>

#include "document/document.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

namespace fs = std::filesystem;

// The names of `design`: its commands and these programs keep out of each other's way.
constexpr const char* kNewPrefix = ".quasilpv-new-";
constexpr const char* kLockPrefix = ".quasilpv-lock-";
constexpr std::size_t kLockDigits = 16;
constexpr int kMostLinks = 40;
constexpr mode_t kModeBeforeUmask = 0666;

bool same_file(const struct stat& one, const struct stat& other) {
  return one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

std::string kind_of(mode_t mode) {
  if (S_ISDIR(mode)) {
    return "a folder";
  }
  if (S_ISCHR(mode) || S_ISBLK(mode)) {
    return "a device";
  }
  if (S_ISFIFO(mode)) {
    return "a named pipe";
  }
  return S_ISSOCK(mode) ? "a socket" : "something else";
}

/// The file a path stands for, links followed, whether it is there yet or not.
fs::path followed(fs::path path) {
  for (int links = 0; fs::is_symlink(fs::symlink_status(path)); ++links) {
    if (links == kMostLinks) {
      throw fs::filesystem_error("", std::make_error_code(std::errc::too_many_symbolic_link_levels));
    }
    path = path.parent_path() / fs::read_symlink(path);
  }
  return fs::canonical(path.has_parent_path() ? path.parent_path() : fs::path(".")) / path.filename();
}

/// A lock of the kernel, which disappears with its process; where a file system has none there is nothing to claim.
bool is_held_by_another(int descriptor) { return flock(descriptor, LOCK_EX | LOCK_NB) == -1 && errno == EWOULDBLOCK; }

std::string content(int descriptor) {
  std::array<char, 200> text{};
  const ssize_t count = pread(descriptor, text.data(), text.size(), 0);
  return {text.data(), count > 0 ? static_cast<std::size_t>(count) : 0};
}

std::string random_digits() {
  std::random_device random;
  std::string digits;
  for (int i = 0; i < 16; ++i) {
    digits += "0123456789abcdef"[random() % 16];
  }
  return digits;
}

}  // namespace

OutputFile::OutputFile(const std::string& path, const std::string& field, const std::string& program,
                       const std::vector<std::string>& inputs)
    : path_(path), field_(field) {
  try {
    place_ = followed(path);
  } catch (const fs::filesystem_error& error) {
    fail(error.code().message());
  }
  require_regular(inputs);
  claim(program);
  try {
    open_new();
  } catch (const InputError&) {
    give_back();
    throw;
  }
}

OutputFile::~OutputFile() { give_back(); }

void OutputFile::give_back() noexcept {
  if (descriptor_ != -1) {
    close(descriptor_);
  }
  if (!new_.empty()) {
    unlink(new_.c_str());
  }
  if (lock_descriptor_ != -1) {
    unlink(lock_.c_str());  // while it is held: nobody else's lock is removed
    close(lock_descriptor_);
  }
}

void OutputFile::require_regular(const std::vector<std::string>& inputs) const {
  struct stat place {};
  if (stat(place_.c_str(), &place) == -1) {
    if (errno != ENOENT) {
      fail(std::strerror(errno));
    }
    return;
  }
  if (!S_ISREG(place.st_mode)) {
    throw InputError(path_, field_, kind_of(place.st_mode), "a regular file, or a name that is free");
  }
  for (const std::string& input : inputs) {
    struct stat read {};
    if (!input.empty() && stat(input.c_str(), &read) == 0 && same_file(place, read)) {
      throw InputError(path_, field_, "an input of this command (" + input + ")", "another file");
    }
  }
  if (access(place_.c_str(), W_OK) == -1) {
    fail(std::strerror(errno));
  }
}

void OutputFile::claim(const std::string& program) {
  lock_ = place_.parent_path() / (kLockPrefix + sha256_hex(place_.filename().string()).substr(0, kLockDigits));
  while (true) {
    const int descriptor = open(lock_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, kModeBeforeUmask);
    if (descriptor == -1) {
      fail(std::strerror(errno));
    }
    if (is_held_by_another(descriptor)) {
      const std::string holder = content(descriptor);
      close(descriptor);
      throw InputError(path_, field_, "the output of " + (holder.empty() ? "another program" : holder) + " too",
                       "one program at a time: wait for its end, or give another file");
    }
    struct stat named {
    }, held{};
    if (stat(lock_.c_str(), &named) == 0 && fstat(descriptor, &held) == 0 && same_file(named, held)) {
      lock_descriptor_ = descriptor;
      const std::string holder = "process " + std::to_string(getpid()) + ", " + program;
      if (ftruncate(descriptor, 0) == -1 ||
          pwrite(descriptor, holder.data(), holder.size(), 0) != static_cast<ssize_t>(holder.size())) {
        return;  // a full disk: the place is claimed all the same, by nobody in particular
      }
      return;
    }
    close(descriptor);  // its holder has just removed it: the lock is that of a file without a name
  }
}

void OutputFile::open_new() {
  const fs::path name = place_.parent_path() / (kNewPrefix + random_digits());
  descriptor_ = open(name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, kModeBeforeUmask);
  if (descriptor_ == -1) {
    fail(std::strerror(errno));
  }
  new_ = name;
  stream_.open(name, std::ios::binary);
  if (!stream_) {
    fail(std::strerror(errno));
  }
}

bool OutputFile::publish() {
  stream_.close();
  const bool whole = stream_.good() && fsync(descriptor_) == 0;
  if (!whole && !cut_to_whole_lines()) {
    return false;
  }
  struct stat before {};
  if (stat(place_.c_str(), &before) == 0) {
    // Few may give a file away; then it is of whoever runs this.
    if (fchown(descriptor_, before.st_uid, before.st_gid) == -1 && errno != EPERM) {
      return false;
    }
    if (fchmod(descriptor_, before.st_mode & 07777) == -1) {
      return false;
    }
  }
  if (rename(new_.c_str(), place_.c_str()) == -1) {
    return false;
  }
  new_.clear();
  return whole;
}

bool OutputFile::cut_to_whole_lines() const {
  constexpr off_t kChunk = 4096;
  std::array<char, kChunk> chunk{};
  off_t end = lseek(descriptor_, 0, SEEK_END);
  while (end > 0) {
    const off_t begin = std::max<off_t>(0, end - kChunk);
    const ssize_t count = pread(descriptor_, chunk.data(), static_cast<std::size_t>(end - begin), begin);
    const std::string_view text(chunk.data(), count > 0 ? static_cast<std::size_t>(count) : 0);
    if (const std::size_t newline = text.rfind('\n'); newline != std::string_view::npos) {
      return ftruncate(descriptor_, begin + static_cast<off_t>(newline) + 1) == 0;
    }
    end = begin;
  }
  return false;
}

void OutputFile::fail(const std::string& got) const {
  throw InputError(path_, field_, got, "a file that can be written");
}

}  // namespace quasilpv
