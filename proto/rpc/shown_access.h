#pragma once
// What a connection shows its server, and whether that would be something else by now: a token that
// a server has left since, a certificate that was renewed.

#include <string>

#include "absl/status/statusor.h"
#include "proto/rpc/access.h"

namespace calib::rpc {

struct ShownAccess {
  Access access{};
  std::string certificate{};  ///< cert.pem of access.tls as it was read; empty: none

  friend bool operator==(const ShownAccess&, const ShownAccess&) = default;
};

/// FindAccess(), with the certificate itself. Errors are those of FindAccess.
absl::StatusOr<ShownAccess> FindShownAccess(const std::string& address, const AccessChoice& choice);

}  // namespace calib::rpc
