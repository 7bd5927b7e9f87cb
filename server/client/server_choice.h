#pragma once
// Which server a command is for.

#include <optional>
#include <string>

namespace calib::client {

struct ServerChoice {
  std::string address = "127.0.0.1:7443";  ///< HOST:PORT
  bool given = false;                      ///< by --server, not by default or $CALIB_SERVER
  std::string state{};                     ///< folder of an embedded server; empty: use `address`
  std::optional<int> workers{};            ///< local workers beside the embedded server
};

}  // namespace calib::client
