#include "mpc/io/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "mpc/core/error.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void ThrowWriteFailed(const fs::path& path, const std::string& reason) {
  throw Error(ErrorCode::kWriteFailed, fmt::format("cannot write {}: {}", path.string(), reason));
}

// A file descriptor that closes itself; Close() reports what the system says about it.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  bool Close() {
    const int fd = fd_;
    fd_ = -1;
    return ::close(fd) == 0;
  }

 private:
  int fd_;
};

void WriteAll(const fs::path& file, const fs::path& shown, std::string_view data) {
  Descriptor out(::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (out.get() < 0) ThrowWriteFailed(shown, std::strerror(errno));
  size_t done = 0;
  while (done < data.size()) {
    const ssize_t n = ::write(out.get(), data.data() + done, data.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      ThrowWriteFailed(shown, fmt::format("{} after {} of {} bytes",
                                          n < 0 ? std::strerror(errno) : "nothing was accepted",
                                          done, data.size()));
    }
    done += static_cast<size_t>(n);
  }
  if (!out.Close()) ThrowWriteFailed(shown, std::strerror(errno));
}

bool IsDevice(const fs::path& path) {
  std::error_code ec;
  const fs::file_status status = fs::status(path, ec);
  return fs::is_character_file(status) || fs::is_fifo(status);
}

}  // namespace

AtomicFile::AtomicFile(const fs::path& path) {
  std::error_code ec;
  path_ = fs::is_symlink(path, ec) ? fs::weakly_canonical(path, ec) : path;
  if (path_.empty()) ThrowWriteFailed(path, "the path is empty or a broken link");
  const fs::path folder = path_.has_parent_path() ? path_.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, ec)) {
    ThrowWriteFailed(path, fmt::format("there is no folder {}", folder.string()));
  }
  if (fs::exists(path_, ec) && !fs::is_regular_file(path_, ec)) {
    ThrowWriteFailed(path, "it exists and is not a regular file");
  }
  static std::atomic<unsigned> counter{0};
  temporary_ = folder / fmt::format("{}.part-{}-{}{}", path_.stem().string(), ::getpid(), ++counter,
                                    path_.extension().string());
}

AtomicFile::~AtomicFile() {
  std::error_code ec;
  fs::remove(temporary_, ec);
}

void AtomicFile::Commit() {
  Descriptor file(::open(temporary_.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0 || ::fsync(file.get()) != 0) ThrowWriteFailed(path_, std::strerror(errno));
  std::error_code ec;
  fs::rename(temporary_, path_, ec);
  if (ec) ThrowWriteFailed(path_, ec.message());
}

void WriteFileAtomically(const fs::path& path, std::string_view data) {
  if (IsDevice(path)) {
    WriteAll(path, path, data);
    return;
  }
  AtomicFile file(path);
  WriteAll(file.temporary(), path, data);
  file.Commit();
}

std::string ReadFile(const fs::path& path, std::uint64_t max_bytes) {
  const auto not_found = [&](const char* reason) {
    return Error(ErrorCode::kFileNotFound,
                 fmt::format("cannot open {}: {}", path.string(), reason));
  };
  const Descriptor in(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (in.get() < 0) throw not_found(std::strerror(errno));
  struct stat info = {};
  if (::fstat(in.get(), &info) != 0) throw not_found(std::strerror(errno));
  if (S_ISDIR(info.st_mode)) throw not_found("it is a folder");
  const auto check_size = [&](std::uint64_t size) {
    if (size <= max_bytes) return;
    throw Error(ErrorCode::kBadFile, fmt::format("{} is larger than the {} bytes allowed here",
                                                 path.string(), max_bytes));
  };
  if (S_ISREG(info.st_mode)) check_size(static_cast<std::uint64_t>(info.st_size));

  std::string content;
  if (S_ISREG(info.st_mode)) content.reserve(static_cast<size_t>(info.st_size));
  char block[1 << 16];
  for (;;) {
    const ssize_t n = ::read(in.get(), block, sizeof(block));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      throw Error(ErrorCode::kBadFile,
                  fmt::format("cannot read {}: {}", path.string(), std::strerror(errno)));
    }
    if (n == 0) return content;
    content.append(block, static_cast<size_t>(n));
    check_size(content.size());
  }
}

}  // namespace mpc
