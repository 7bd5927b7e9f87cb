#include "proto/rpc/address.h"

#include <arpa/inet.h>

#include <charconv>
#include <cstdint>
#include <string_view>

#include "absl/strings/str_cat.h"

namespace calib::rpc {
namespace {

constexpr std::string_view kSocket = "unix:";

bool IsHost(const std::string& host) {
  if (host.starts_with('[')) {
    return host.size() > 2 &&
           host.find_first_not_of("0123456789abcdefABCDEF:.%", 1) == host.size() - 1 &&
           host.back() == ']';
  }
  return !host.empty() && host.find_first_of(":/[]@ \t\r\n") == std::string::npos;
}

}  // namespace

// gRPC looks up a host that is none, and takes a port above 65535 modulo 65536.
std::string ProblemOfAddress(const std::string& address, int least_port) {
  if (address.starts_with(kSocket)) {
    const std::string path = SocketPathOf(address);
    if (path.starts_with('/') && path.size() <= kLongestSocketPath) return "";
    return absl::StrCat("'", address, "' is not unix:/PATH with a path of at most ",
                        kLongestSocketPath, " bytes");
  }
  const std::size_t colon = address.rfind(':');
  int port = -1;
  if (colon != std::string::npos && IsHost(HostOf(address))) {
    const char* const end = address.data() + address.size();
    const auto [at, error] = std::from_chars(address.data() + colon + 1, end, port);
    if (error != std::errc() || at != end) port = -1;
  }
  if (port >= least_port && port <= 65535) return "";
  return absl::StrCat("'", address, "' is not HOST:PORT with a port from ", least_port,
                      " to 65535");
}

std::string HostOf(const std::string& address) { return address.substr(0, address.rfind(':')); }

int PortOf(const std::string& address) {
  int port = 0;
  std::from_chars(address.data() + address.rfind(':') + 1, address.data() + address.size(), port);
  return port;
}

std::string SocketPathOf(const std::string& address) {
  return address.starts_with(kSocket) ? address.substr(kSocket.size()) : std::string();
}

bool IsLoopback(const std::string& address) {
  const std::string host = HostOf(address);
  in_addr numbers{};
  constexpr std::uint32_t kLoopbackNet = 127;
  return address.starts_with(kSocket) || host == "localhost" || host == "[::1]" ||
         (inet_pton(AF_INET, host.c_str(), &numbers) == 1 &&
          ntohl(numbers.s_addr) >> 24 == kLoopbackNet);
}

}  // namespace calib::rpc
