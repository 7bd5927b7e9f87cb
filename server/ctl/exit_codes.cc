#include "server/ctl/exit_codes.h"

#include <iostream>

namespace calib::ctl {

int Fail(const absl::Status& status) {
  if (status.ok()) return kDone;
  std::cerr << "calibctl: " << status.message() << "\n";
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
      return kUnreachable;
    case absl::StatusCode::kInvalidArgument:
      return kBadInput;
    default:
      return kFailed;
  }
}

}  // namespace calib::ctl
