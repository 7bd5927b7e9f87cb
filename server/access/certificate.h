#pragma once
// Certificates of calib as their readers see them: what a folder holds, whom a peer's is of.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/access/role.h"

namespace calib::access {

/// "2026-11-01": the day in UTC, for people.
std::string DateOf(std::int64_t unix_s);

/// What a certificate says of the one it was issued to.
struct Holder {
  std::string name;
  Role role = Role::kViewer;
  std::string serial{};                ///< hexadecimal, lower case, two digits per byte
  std::int64_t not_before_unix_s = 0;  ///< [s since 1970] valid from then on
  std::int64_t not_after_unix_s = 0;   ///< [s since 1970] valid until then, and no more at it
  std::vector<std::string> hosts{};    ///< of role server: names and addresses that it answers to
};

/// What a folder of `calibctl certs issue` holds. key_pem is a secret: it belongs into no message.
struct Credentials {
  std::string ca_pem, cert_pem, key_pem, crl_pem;
  Holder holder;
};

/// Reads ca.pem, cert.pem, key.pem and crl.pem of `folder` once. Whether they are valid by now is
/// not asked (`holder` says until when), so that a renewal can begin from an expired one.
/// Errors are sentences that name the file and what would be right: NOT_FOUND (no such folder or
/// file), INVALID_ARGUMENT (no PEM, a certificate of another authority or without a role, a key
/// that belongs to another certificate), PERMISSION_DENIED (unreadable, or a key that others than
/// its owner may read). Waits up to 100 ms for key and certificate to belong together.
absl::StatusOr<Credentials> ReadCredentials(const std::string& folder);

/// Whether the folder's own certificate can be shown at `now_unix_s` [s since 1970].
/// FAILED_PRECONDITION, a sentence: it has expired, is not valid yet, or stands in its own crl.pem.
absl::Status CheckOwn(const Credentials& credentials, std::int64_t now_unix_s);

/// Finishes a renewal of `folder` that was killed after its certificate and before its key was put
/// in place, which gRPC could not use; OK, and nothing done, where there is none. A renewal that
/// goes on is waited for. Errors: PERMISSION_DENIED or RESOURCE_EXHAUSTED, the folder cannot be
/// written.
absl::Status FinishRenewal(const std::string& folder);

/// Judges certificates of peers that ask, against the authority and the revocations of a folder.
/// Thread-safe.
class Verifier {
 public:
  /// Reads ca.pem and crl.pem of `folder`; errors as those of ReadCredentials. `folder` may be
  /// one of `certs issue` or of `certs init`.
  static absl::StatusOr<std::unique_ptr<Verifier>> Open(const std::string& folder);
  ~Verifier();
  Verifier(const Verifier&) = delete;
  Verifier& operator=(const Verifier&) = delete;

  /// Who holds the certificate `cert_pem` (the leaf, maybe followed by a chain, which is not
  /// needed) and may ask with it at `now_unix_s` [s since 1970]. Once for each new second of
  /// `now_unix_s` it looks whether ca.pem or crl.pem were replaced, and reads them again; files
  /// that are broken, or belong to different authorities, leave the last good ones in force and
  /// are logged once. Errors: UNAUTHENTICATED, one sentence that names the certificate.
  absl::StatusOr<Holder> Verify(const std::string& cert_pem, std::int64_t now_unix_s);

 private:
  struct State;
  explicit Verifier(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace calib::access
