// Purpose: run the command as a user does: exit codes, what it prints, signals.
#pragma once

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <chrono>
#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "io/temp_dir.h"
#include "mpc/io/atomic_file.h"

extern char** environ;

namespace mpc::testing {

struct Outcome {
  int exit_code = -1;  // 128 + signal when it was killed
  std::string out;
  std::string err;
};

// A running command whose output goes to files.
class Process {
 public:
  explicit Process(std::vector<std::string> arguments) {
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    const std::string out = (folder_ / "out").string();
    const std::string err = (folder_ / "err").string();
    posix_spawn_file_actions_addopen(&actions, 1, out.c_str(), O_WRONLY | O_CREAT, 0600);
    posix_spawn_file_actions_addopen(&actions, 2, err.c_str(), O_WRONLY | O_CREAT, 0600);
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    if (posix_spawnp(&pid_, argv[0], &actions, nullptr, argv.data(), environ) != 0) pid_ = -1;
    posix_spawn_file_actions_destroy(&actions);
  }

  void Signal(int signal) const { ::kill(pid_, signal); }
  std::string Err() const {
    return std::filesystem::exists(folder_ / "err") ? ReadFile(folder_ / "err") : "";
  }

  bool IsRunning() const {
    siginfo_t info{};
    ::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT);
    return info.si_pid == 0;
  }

  // Until this stands in what it wrote to stderr, at most a minute.
  void WaitFor(const std::string& text) const {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (Err().find(text) == std::string::npos && std::chrono::steady_clock::now() < deadline) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }

  Outcome Wait() const {
    Outcome outcome;
    int status = 0;
    if (pid_ < 0 || ::waitpid(pid_, &status, 0) != pid_) return outcome;
    outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    outcome.out = ReadFile(folder_ / "out");
    outcome.err = Err();
    return outcome;
  }

 private:
  TempDir folder_;
  pid_t pid_ = -1;
};

inline Outcome RunCommand(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), MPC_COMMAND);
  return Process(std::move(arguments)).Wait();
}

inline std::set<std::string> FilesIn(const std::filesystem::path& folder) {
  std::set<std::string> names;
  if (!std::filesystem::is_directory(folder)) return names;
  for (const std::filesystem::directory_entry& entry :
       std::filesystem::directory_iterator(folder)) {
    names.insert(entry.path().filename().string());
  }
  return names;
}

// Exit code 1 and, after any warnings, one line "monoperfcap: error: ...".
inline void ExpectOneSentence(const Outcome& outcome, const std::string& part) {
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  std::istringstream stream(outcome.err);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  ASSERT_THAT(lines, ::testing::Not(::testing::IsEmpty()));
  EXPECT_THAT(lines.back(), ::testing::StartsWith("monoperfcap: error: "));
  EXPECT_THAT(lines.back(), ::testing::HasSubstr(part));
  lines.pop_back();
  EXPECT_THAT(lines, ::testing::Each(::testing::StartsWith("monoperfcap: warning: ")));
}

}  // namespace mpc::testing
