#pragma once
// The log of a server: lines of `event key=value ...` for people or one JSON object a line for
// machines, on standard error or in a file that is changed before it grows too large.

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"

namespace spdlog {
class formatter;
}

namespace calib::service {

struct LogForm {
  bool json = false;
  std::int64_t file_mib = 64;  ///< one that would grow larger is begun anew; 0: it may
  int files = 5;               ///< earlier ones that stay, as FILE.1.log, FILE.2.log; >= 1
};

/// Whatever the program logs goes there from now on; file: appended to, its owner's alone; empty:
/// standard error. RESOURCE_EXHAUSTED, a sentence: it cannot be written.
absl::Status StartLog(const std::string& file, const LogForm& form);

/// {"time": "...Z", "level", "event", KEY: "VALUE"...} of `event key=value key="some words"`; what
/// is not so stands under "message".
std::unique_ptr<spdlog::formatter> MakeJsonFormatter();

}  // namespace calib::service
