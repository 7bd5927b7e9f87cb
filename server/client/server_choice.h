#pragma once
// Which server a command is for.

#include <optional>
#include <string>

namespace calib::client {

struct ServerChoice {
  std::string address = "127.0.0.1:7443";  ///< HOST:PORT or unix:/PATH
  bool given = false;                      ///< by --server, not by default or $CALIB_SERVER
  std::string state{};                     ///< folder of an embedded server; empty: use `address`
  std::string tls{};                       ///< folder of `calibctl certs issue`; empty: none
  std::string token{};                     ///< file of the server's token; empty: where it is left
  std::optional<int> workers{};            ///< local workers beside the embedded server
};

}  // namespace calib::client
