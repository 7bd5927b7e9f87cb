#pragma once
// HOST:PORT as calibd and calibctl are told it.

#include <string>

namespace calib::service {

/// True where only this machine is reached by the address. Names are not looked up.
bool IsLoopback(const std::string& address);

}  // namespace calib::service
