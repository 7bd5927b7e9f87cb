#pragma once
// issued.csv of an authority: every certificate that it has issued, in the order of issue. The
// truth about revocations; crl.pem is made of it.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/role.h"

namespace calib::access {

struct IssuedCertificate {
  std::string serial;  ///< hexadecimal, lower case
  std::string name;
  Role role = Role::kViewer;
  std::int64_t not_after_unix_s = 0;
  std::optional<std::int64_t> revoked_unix_s{};

  bool IsInForce(std::int64_t now_unix_s) const {
    return !revoked_unix_s && now_unix_s < not_after_unix_s;
  }
};
using Ledger = std::vector<IssuedCertificate>;

/// FAILED_PRECONDITION with the line where it is none.
absl::StatusOr<Ledger> ReadLedger(const std::string& path);
absl::Status WriteLedger(const std::string& path, const Ledger& ledger);  ///< replaces the file

}  // namespace calib::access
