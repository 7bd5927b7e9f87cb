#pragma once
// Where a server is, as every program is told it: HOST:PORT, or unix:/PATH of a socket.

#include <cstddef>
#include <string>

namespace calib::rpc {

/// The longest path of a socket [bytes], without the zero that ends it (sun_path of unix(7)).
inline constexpr std::size_t kLongestSocketPath = 107;

/// Empty for HOST:PORT with a port from `least_port` (0: a server may take any) to 65535, and for
/// unix:/PATH, else a sentence. HOST is a name or an IPv4 address, or an IPv6 address in brackets;
/// it is not looked up.
std::string ProblemOfAddress(const std::string& address, int least_port = 1);

/// The HOST of HOST:PORT, and its PORT, which has no problem (ProblemOfAddress).
std::string HostOf(const std::string& address);
int PortOf(const std::string& address);

/// The path of unix:/PATH; empty: it is another address.
std::string SocketPathOf(const std::string& address);

/// True where only this machine is reached by the address, a socket included. Names are not looked
/// up.
bool IsLoopback(const std::string& address);

}  // namespace calib::rpc
