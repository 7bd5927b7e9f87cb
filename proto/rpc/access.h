#pragma once
// What a program shows a server to be let in: a certificate, or the token of its state folder. A
// server that listens on a socket of a private folder wants neither.

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::rpc {

/// As users say it; each may be empty.
struct AccessChoice {
  std::string tls{};    ///< folder of `calibctl certs issue` [$CALIB_TLS]
  std::string token{};  ///< file that holds a token [$CALIB_TOKEN, which may be the token itself]
  /// The token is of a server of this account, and shown to no listener of another.
  bool is_own = false;

  friend bool operator==(const AccessChoice&, const AccessChoice&) = default;
};

struct Access {
  std::string tls{};    ///< folder of a certificate; empty: plain text
  std::string token{};  ///< 64 hexadecimal digits; empty: none
  /// The token is not shown while another account listens at this TCP port; 0: to whoever answers.
  int own_port = 0;

  friend bool operator==(const Access&, const Access&) = default;
};

/// What this program has for the server at `address`: nothing where that is a socket, which asks
/// for nothing. Without a choice and an environment variable: the newest token that a server
/// of this account on this machine has left for it, if there is one. Errors, INVALID_ARGUMENT: a
/// file that is named and cannot be read or holds no token, a folder that is none.
absl::StatusOr<Access> FindAccess(const std::string& address, const AccessChoice& choice);

/// Whether anything that listens at a TCP port of this machine belongs to another account, as what
/// has taken the port of a server that ended. Where nothing listens nobody reads what is shown.
bool AnotherAccountListens(int port);

/// Whether a text is a token: 64 hexadecimal digits.
bool IsToken(const std::string& text);

/// What is in a file that holds a token. INVALID_ARGUMENT, a sentence: it cannot be read, or holds
/// none.
absl::StatusOr<std::string> ReadToken(const std::string& path);

/// Folders in which the token of the server at a port is left for programs of the same account, the
/// best first: $XDG_RUNTIME_DIR/calib, ~/.cache/calib. The file is PORT.token.
std::vector<std::string> TokenFolders();
std::string TokenName(int port);

}  // namespace calib::rpc
