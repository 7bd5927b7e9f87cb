#pragma once
// Names that no other request or process bears.

#include <string>

namespace calib::rpc {

/// 128 bits of the system's randomness, 32 hexadecimal digits.
std::string RandomId();

}  // namespace calib::rpc
