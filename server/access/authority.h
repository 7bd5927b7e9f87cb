#pragma once
// The authority of an installation: a folder that issues and revokes certificates. Needs no server.
// Every file is written aside, made safe on disk and renamed, so a kill at any moment leaves the
// old one or the new one whole. Two processes at one folder wait for each other.

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/certificate.h"
#include "server/access/role.h"

namespace calib::access {

/// Makes a folder (mode 0700) with ca.pem, ca-key.pem (0600), crl.pem and issued.csv (0600), valid
/// for ten years; it appears as a whole. ALREADY_EXISTS where the folder is not empty, and then
/// stays as it is.
absl::Status InitAuthority(const std::string& folder);

/// Until when an authority, or a folder that it issued, can be used [s since 1970].
absl::StatusOr<std::int64_t> EndOfAuthority(const std::string& folder);

struct Request {
  std::string name;  ///< 1 to 64 of A-Z a-z 0-9 . _ @ -
  Role role = Role::kViewer;
  /// DNS names and addresses of a server, beside localhost, 127.0.0.1 and ::1, which it always has.
  /// Of other roles: none.
  std::vector<std::string> hosts{};
  int days = 365;  ///< validity [days]: 1 to 3650, not beyond the end of the authority
};

/// Issues a certificate with a fresh key into `out_folder` (made with mode 0700): ca.pem, cert.pem,
/// key.pem (0600), crl.pem. Where it holds a certificate of the same name and role, that is
/// renewed; a server without `hosts` then keeps those it had. Errors: INVALID_ARGUMENT (one line
/// per problem of the request), NOT_FOUND (no authority there), FAILED_PRECONDITION (`out_folder`
/// is of another authority, name or role; the name has a valid certificate of another role; others
/// than the owner may change a folder; issued.csv is damaged), PERMISSION_DENIED,
/// RESOURCE_EXHAUSTED.
absl::StatusOr<Holder> Issue(const std::string& authority_folder, const Request& request,
                             const std::string& out_folder);

/// Revokes every certificate of `name` that is neither revoked nor expired and writes crl.pem of
/// the authority, with a higher number than before. How many were revoked; NOT_FOUND where the name
/// was never issued, else as Issue. Servers refuse them once crl.pem is copied into their folders,
/// and clients a server once it is copied into theirs.
absl::StatusOr<int> Revoke(const std::string& authority_folder, const std::string& name);

}  // namespace calib::access
