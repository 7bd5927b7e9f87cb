#pragma once
// Certificates, keys and lists of revocations in memory, between PEM and OpenSSL. Pure.

#include <openssl/evp.h>
#include <openssl/x509.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/certificate.h"

namespace calib::access {

struct OpensslFree {
  void operator()(X509* it) const { X509_free(it); }
  void operator()(X509_CRL* it) const { X509_CRL_free(it); }
  void operator()(EVP_PKEY* it) const { EVP_PKEY_free(it); }
};
using X509Ptr = std::unique_ptr<X509, OpensslFree>;
using CrlPtr = std::unique_ptr<X509_CRL, OpensslFree>;
using KeyPtr = std::unique_ptr<EVP_PKEY, OpensslFree>;

/// INTERNAL: "WHAT failed: REASON", with the reasons that OpenSSL keeps for this thread, which it
/// then forgets.
absl::Status OpensslError(const std::string& what);

/// The first of its kind in `pem`; null where there is none. A key under a password counts as none.
X509Ptr ParseCertificate(const std::string& pem);
CrlPtr ParseRevocations(const std::string& pem);
KeyPtr ParseKey(const std::string& pem);

absl::StatusOr<std::string> PemOf(X509* certificate);
absl::StatusOr<std::string> PemOf(X509_CRL* revocations);
absl::StatusOr<std::string> PemOf(EVP_PKEY* key);

bool IsKeyOf(EVP_PKEY* key, X509* certificate);
bool IsIssuedBy(X509* certificate, X509* authority);  ///< by name and signature
bool IsIssuedBy(X509_CRL* revocations, X509* authority);

/// Hexadecimal in lower case, two digits per byte.
std::string HexOf(const ASN1_INTEGER* serial);
std::int64_t UnixSeconds(const ASN1_TIME* time);
std::vector<std::string> RevokedSerials(X509_CRL* revocations);  ///< sorted

/// Whether `name` may be a holder's: 1 to 64 of A-Z a-z 0-9 . _ @ -
bool IsName(const std::string& name);
/// The certificate's name for messages, whoever made it: printable, at most 64 bytes.
std::string NameForMessages(X509* certificate);
/// INVALID_ARGUMENT: "the certificate of NAME states no role: ...".
absl::StatusOr<Holder> HolderOf(X509* certificate);

/// ca.pem and crl.pem of a folder.
struct Trust {
  std::string ca_pem, crl_pem;
  X509Ptr ca;
  CrlPtr crl;
};
/// Errors are those of ReadCredentials.
absl::StatusOr<Trust> ReadTrust(const std::string& folder);

}  // namespace calib::access
