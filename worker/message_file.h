#pragma once
// Files that --once and --once-program read.

#include <google/protobuf/message.h>

#include <optional>
#include <string>

#include "absl/status/status.h"

namespace calib::worker {

/// The whole content; empty: it cannot be read.
std::optional<std::string> ContentOf(const std::string& path);

/// Reads a message from its JSON (a text that begins with `{`) or its binary form. INVALID_ARGUMENT
/// with the path: it cannot be read or is no such message.
absl::Status ReadMessageFile(const std::string& path, google::protobuf::Message& message);

}  // namespace calib::worker
