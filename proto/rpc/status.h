#pragma once
// absl::Status inside the program, grpc::Status on the wire: the same codes, the same message.

#include <grpcpp/support/status.h>

#include "absl/status/status.h"

namespace calib::rpc {

grpc::Status ToGrpc(const absl::Status& status);
absl::Status FromGrpc(const grpc::Status& status);

/// True for the codes after which the same call may be made again: UNAVAILABLE and
/// RESOURCE_EXHAUSTED.
bool IsRetryable(absl::StatusCode code);

}  // namespace calib::rpc
