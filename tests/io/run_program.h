// Purpose: run another program and see what it prints.
#pragma once

#include <cstdio>
#include <string>

namespace mpc::testing {

struct ProgramResult {
  int status = -1;  // 0: success
  std::string output;
};

inline ProgramResult RunProgram(const std::string& command) {
  ProgramResult result;
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return result;
  char block[4096];
  while (const size_t n = std::fread(block, 1, sizeof(block), pipe)) result.output.append(block, n);
  result.status = ::pclose(pipe);
  return result;
}

}  // namespace mpc::testing
