#include "mpc/io/atomic_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>

#include "io/temp_dir.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

size_t NumEntries(const fs::path& folder) {
  return static_cast<size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(AtomicFileTest, WritesWhatReadFileReads) {
  const testing::TempDir dir;
  std::string data(300000, 'x');
  data[7] = '\0';
  WriteFileAtomically(dir / "a.bin", "old");
  WriteFileAtomically(dir / "a.bin", data);
  EXPECT_EQ(ReadFile(dir / "a.bin"), data);
  EXPECT_EQ(NumEntries(dir.path()), 1u);
}

TEST(AtomicFileTest, WithoutCommitNothingIsLeft) {
  const testing::TempDir dir;
  {
    AtomicFile file(dir / "a.mp4");
    EXPECT_EQ(file.temporary().extension(), ".mp4");
    WriteFileAtomically(file.temporary(), "half");
  }
  EXPECT_EQ(NumEntries(dir.path()), 0u);
  AtomicFile never_written(dir / "b.mp4");
  EXPECT_MPC_ERROR(never_written.Commit(), kWriteFailed, "b.mp4");
}

TEST(AtomicFileTest, FollowsLinks) {
  const testing::TempDir dir;
  dir.Write("target", "old");
  fs::create_symlink("target", dir / "link");
  WriteFileAtomically(dir / "link", "new");
  EXPECT_TRUE(fs::is_symlink(dir / "link"));
  EXPECT_EQ(ReadFile(dir / "target"), "new");
}

TEST(AtomicFileTest, ReportsWhatCannotBeWritten) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(WriteFileAtomically("/dev/full", "x"), kWriteFailed, "No space left");
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
  EXPECT_MPC_ERROR(WriteFileAtomically(dir / "no/a", "x"), kWriteFailed, "there is no folder");
  EXPECT_MPC_ERROR(WriteFileAtomically(dir.Write("f", "") / "a", "x"), kWriteFailed, "f");
  EXPECT_MPC_ERROR(WriteFileAtomically(dir.path(), "x"), kWriteFailed, "not a regular file");
  EXPECT_MPC_ERROR(WriteFileAtomically("", "x"), kWriteFailed, "empty");
  EXPECT_MPC_ERROR(WriteFileAtomically("/proc/a", "x"), kWriteFailed, "/proc/a");
}

// In a child process with a limit of 1000 bytes per file: the old file stays, the error is thrown.
TEST(AtomicFileTest, SurvivesAWriteThatFailsHalfWay) {
  const testing::TempDir dir;
  dir.Write("a", "old");
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit = {1000, 1000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    int code = 1;
    try {
      WriteFileAtomically(dir / "a", std::string(5000, 'x'));
    } catch (const Error& error) {
      const std::string message = error.what();
      const bool says_how_far = message.find("after 1000 of 5000 bytes") != std::string::npos;
      code = error.code() == ErrorCode::kWriteFailed && says_how_far ? 0 : 2;
    }
    ::_exit(code);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(ReadFile(dir / "a"), "old");
  EXPECT_EQ(NumEntries(dir.path()), 1u);
}

TEST(AtomicFileTest, ReadFileReportsWhatCannotBeRead) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(ReadFile(dir / "missing"), kFileNotFound, "missing");
  EXPECT_MPC_ERROR(ReadFile(dir.path()), kFileNotFound, "folder");
  EXPECT_MPC_ERROR(ReadFile(dir.Write("a", "12345"), 4), kBadFile, "larger than the 4 bytes");
  EXPECT_MPC_ERROR(ReadFile("/dev/zero", 100000), kBadFile, "larger");
  EXPECT_EQ(ReadFile(dir.Write("a", "1234"), 4), "1234");
}

}  // namespace
}  // namespace mpc
