#pragma once
// HOST:PORT as every program is told it.

#include <string>

namespace calib::rpc {

/// Empty for HOST:PORT with a port from `least_port` (0: a server may take any) to 65535, else a
/// sentence. HOST is a name or an IPv4 address, or an IPv6 address in brackets; it is not looked
/// up.
std::string ProblemOfAddress(const std::string& address, int least_port = 1);

/// The HOST of HOST:PORT, which has no problem (ProblemOfAddress).
std::string HostOf(const std::string& address);

/// True where only this machine is reached by the address. Names are not looked up.
bool IsLoopback(const std::string& address);

}  // namespace calib::rpc
