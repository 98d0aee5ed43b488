// Purpose: files that are either complete or not there: written beside their place, then renamed.
//
// A program that wants a full disk quota (RLIMIT_FSIZE) to end in an Error instead of a signal
// ignores SIGXFSZ: std::signal(SIGXFSZ, SIG_IGN).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace mpc {

// A place for an output while it is being made. Another library writes to temporary(); Commit()
// moves the finished file to its place. Without Commit() the temporary is removed. Symbolic links
// are followed, so a link stays a link.
class AtomicFile {
 public:
  // Throws Error (kWriteFailed) when the folder is missing or the target is not a regular file.
  explicit AtomicFile(const std::filesystem::path& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  // Same folder and extension as the target.
  const std::filesystem::path& temporary() const { return temporary_; }

  // Flushes the temporary to the disk and renames it. Throws Error (kWriteFailed) when it is not
  // there or one of both fails.
  void Commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_;
};

// Writes `data` as the whole content of `path`, flushed to the disk before it takes its place (a
// device such as /dev/stdout is written directly). Every step is checked: throws Error
// (kWriteFailed) with path and reason, and leaves an older file at `path` untouched.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view data);

inline constexpr std::uint64_t kDefaultMaxFileBytes = std::uint64_t{1} << 30;

// The whole content of a file. Throws Error: kFileNotFound when it cannot be opened (or is a
// folder), kBadFile when it is larger than max_bytes or cannot be read to its end.
std::string ReadFile(const std::filesystem::path& path,
                     std::uint64_t max_bytes = kDefaultMaxFileBytes);

}  // namespace mpc
