#pragma once
// How an authority's key makes certificates and lists of revocations. Errors are INTERNAL, with
// OpenSSL's reasons.

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/access/ledger.h"
#include "server/access/role.h"
#include "server/access/x509.h"

namespace calib::access {

struct Validity {
  std::int64_t not_before_unix_s, not_after_unix_s;
};

absl::StatusOr<KeyPtr> MakeKey();  ///< EC P-256

/// A certificate of an authority by its own key: below it stand leaves only.
absl::StatusOr<X509Ptr> SignAuthority(EVP_PKEY* key, const Validity& validity);

struct Leaf {
  std::string name;
  Role role;
  std::vector<std::string> hosts;  ///< of role server: DNS names and addresses; else empty
  Validity validity;
};
/// key: of the leaf. The certificate can ask a server or be one, never both.
absl::StatusOr<X509Ptr> SignLeaf(const Leaf& leaf, EVP_PKEY* key, X509* ca, EVP_PKEY* ca_key);

struct RevocationList {
  std::vector<IssuedCertificate> revoked;  ///< each with the time of its revocation
  std::int64_t number;                     ///< above that of every list before
  Validity validity;
};
absl::StatusOr<CrlPtr> SignRevocations(const RevocationList& list, X509* ca, EVP_PKEY* ca_key);

/// 0 where it states none.
std::int64_t NumberOf(X509_CRL* revocations);

/// Whether it is an address (IPv4, IPv6) rather than a DNS name.
bool IsAddress(const std::string& host);

}  // namespace calib::access
