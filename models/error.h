// Errors that a user sees: what is wrong, where, and what would mend it.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace lobefit {

/// Exit codes of the command line; others script against them.
enum class ExitCode {
  done = 0,
  failure = 1,        // internal, or a write failed
  usage = 2,          // the command line is wrong
  invalid_input = 3,  // a file is unreadable or invalid
  not_converged = 4,  // a fit stopped early; its result is written, marked
  check_failed = 5,   // a check ran and exceeded its bound
  missing_part = 6,   // a device or an optional part is absent
  interrupted = 130,
};

class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& what, const std::string& where, const std::string& mend)
      : std::runtime_error(what + (where.empty() ? "" : " (" + where + ")") + (mend.empty() ? "" : ": " + mend)),
        code_(code),
        what_(what),
        where_(where),
        mend_(mend) {}

  ExitCode code() const { return code_; }

  /// The same fault met while reading `place`: code and place change, the advice stays.
  Error inside(ExitCode code, const std::string& place) const {
    return {code, what_, where_.empty() ? place : place + ", " + where_, mend_};
  }

 private:
  ExitCode code_;
  std::string what_, where_, mend_;
};

/// Thrown out of long work when the user pressed Ctrl-C.
class Interrupted : public Error {
 public:
  Interrupted() : Error(ExitCode::interrupted, "interrupted", "", "finished files were kept") {}
};

}  // namespace lobefit
