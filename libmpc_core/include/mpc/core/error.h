// Purpose: the one exception type of the library and the codes a program can act on.
//
// Misuse and bad files throw mpc::Error. A solver's outcome is never an exception: it is a returned
// Summary. The message is one sentence that names the place (file, line, byte or field), what was
// found and what was expected.
#pragma once

#include <stdexcept>
#include <string>

namespace mpc {

enum class ErrorCode {
  kInvalidArgument,  // the caller's values or sizes are wrong
  kFileNotFound,     // a file or folder to read is not there or not readable
  kBadFile,          // a file's content is broken or of another kind
  kMismatch,         // two inputs do not belong together (sizes, frame counts, resolutions)
  kUnsupported,      // valid, but not something this version can do
  kWriteFailed,      // an output could not be written completely
  kCancelled,        // the progress callback asked to stop
};

// Short lower-case name, such as "bad file".
const char* ErrorCodeName(ErrorCode code);

class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

}  // namespace mpc
