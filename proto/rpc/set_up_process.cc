#include "proto/rpc/set_up_process.h"

#include <cstdlib>

#include "absl/synchronization/mutex.h"

namespace calib::rpc {

void SetUpProcess() {
  setenv("GRPC_VERBOSITY", "NONE", 0);
  absl::SetMutexDeadlockDetectionMode(absl::OnDeadlockCycle::kIgnore);
}

}  // namespace calib::rpc
