#include "proto/rpc/random_id.h"

#include <random>

#include "absl/strings/str_cat.h"

namespace calib::rpc {

std::string RandomId() {
  std::random_device device;
  std::string id;
  for (int word = 0; word < 4; ++word) absl::StrAppend(&id, absl::Hex(device(), absl::kZeroPad8));
  return id;
}

}  // namespace calib::rpc
