#pragma once
// Writing an answer to a file, all of it or an error that names the file.

#include <string>

#include "absl/status/status.h"

namespace calib::ctl {

/// PERMISSION_DENIED with the path and the reason when it cannot be written.
absl::Status WriteFile(const std::string& path, const std::string& content);

}  // namespace calib::ctl
