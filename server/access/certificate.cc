#include "server/access/certificate.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/return_if_error.h"
#include "server/access/files.h"
#include "server/access/x509.h"

namespace calib::access {
namespace {

// Between the two renames of a renewal lie microseconds.
constexpr int kReadings = 20;
constexpr absl::Duration kBetweenReadings = absl::Milliseconds(5);

/// The key of `certificate`. A renewal that was killed between its two renames has left the key
/// where it was written.
absl::StatusOr<std::string> ReadKeyOf(X509* certificate, const std::string& folder) {
  const std::string path = folder + "/key.pem";
  absl::Status problem;
  for (const std::string& place : {path, DraftOf(path)}) {
    const auto pem = ReadSecret(place);
    const KeyPtr key = pem.ok() ? ParseKey(*pem) : nullptr;
    if (key && IsKeyOf(key.get(), certificate)) return *pem;
    if (place != path) continue;
    if (!pem.ok()) {
      problem = pem.status();
    } else if (!key) {
      problem = absl::InvalidArgumentError(
          absl::StrCat(path, " holds no key in PEM without a password: `calibctl certs issue` ",
                       "into this folder writes one"));
    } else {
      problem = absl::AbortedError(
          absl::StrCat(path, " is not the key of ", folder, "/cert.pem: copy both from one folder ",
                       "of `calibctl certs issue`, or issue again into this one"));
    }
  }
  return problem;
}

/// ABORTED where key and certificate do not belong together.
absl::StatusOr<Credentials> ReadOnce(const std::string& folder) {
  const std::string path = folder + "/cert.pem";
  ASSIGN_OR_RETURN(Trust trust, ReadTrust(folder));
  Credentials result;
  result.ca_pem = std::move(trust.ca_pem);
  result.crl_pem = std::move(trust.crl_pem);
  ASSIGN_OR_RETURN(result.cert_pem, ReadFile(path));
  const X509Ptr certificate = ParseCertificate(result.cert_pem);
  if (!certificate) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, " holds no certificate in PEM: `calibctl certs issue` into this folder writes one"));
  }
  if (!IsIssuedBy(certificate.get(), trust.ca.get())) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " was not issued by the authority of ", folder,
                     "/ca.pem: copy both from one folder of `calibctl certs issue`"));
  }
  auto holder = HolderOf(certificate.get());
  if (!holder.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": ", std::string(holder.status().message())));
  }
  result.holder = *std::move(holder);
  ASSIGN_OR_RETURN(result.key_pem, ReadKeyOf(certificate.get(), folder));
  return result;
}

}  // namespace

std::string DateOf(std::int64_t unix_s) {
  return absl::FormatTime("%Y-%m-%d", absl::FromUnixSeconds(unix_s), absl::UTCTimeZone());
}

absl::StatusOr<Credentials> ReadCredentials(const std::string& folder) {
  absl::StatusOr<Credentials> result = ReadOnce(folder);
  for (int i = 1; i < kReadings && absl::IsAborted(result.status()); ++i) {
    absl::SleepFor(kBetweenReadings);
    result = ReadOnce(folder);
  }
  if (absl::IsAborted(result.status())) {
    return absl::InvalidArgumentError(std::string(result.status().message()));
  }
  if (absl::IsNotFound(result.status())) {
    return absl::NotFoundError(absl::StrCat(std::string(result.status().message()),
                                            ": `calibctl certs issue CA --role ", "ROLE NAME -o ",
                                            folder, "` writes it"));
  }
  return result;
}

absl::Status CheckOwn(const Credentials& credentials, std::int64_t now_unix_s) {
  const Holder& holder = credentials.holder;
  const auto refuse = [&holder](const std::string& why) {
    return absl::FailedPreconditionError(absl::StrCat("the certificate of ", holder.name, why));
  };
  const std::string again = absl::StrCat(": `calibctl certs issue CA --role ", NameOf(holder.role),
                                         " ", holder.name, " -o FOLDER` makes a new one");
  if (now_unix_s < holder.not_before_unix_s) {
    return refuse(absl::StrCat(" is not valid before ", DateOf(holder.not_before_unix_s),
                               ": look at this machine's clock"));
  }
  if (now_unix_s >= holder.not_after_unix_s) {
    return refuse(absl::StrCat(" has expired on ", DateOf(holder.not_after_unix_s), again));
  }
  const CrlPtr revocations = ParseRevocations(credentials.crl_pem);
  const X509Ptr own = ParseCertificate(credentials.cert_pem);
  if (revocations != nullptr && own != nullptr) {
    const auto revoked = RevokedSerials(revocations.get());
    if (std::binary_search(revoked.begin(), revoked.end(),
                           HexOf(X509_get0_serialNumber(own.get())))) {
      return refuse(absl::StrCat(" was revoked", again));
    }
  }
  return absl::OkStatus();
}

absl::Status FinishRenewal(const std::string& folder) {
  if (::access(DraftOf(folder + "/key.pem").c_str(), F_OK) != 0) return absl::OkStatus();
  ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::TakeItself(folder));
  const auto cert_pem = ReadFile(folder + "/cert.pem");
  const auto key_pem = ReadSecret(DraftOf(folder + "/key.pem"));
  if (!cert_pem.ok() || !key_pem.ok()) return absl::OkStatus();
  const X509Ptr certificate = ParseCertificate(*cert_pem);
  const KeyPtr key = ParseKey(*key_pem);
  if (!certificate || !key || !IsKeyOf(key.get(), certificate.get())) return absl::OkStatus();
  RETURN_IF_ERROR(PutDraft(folder + "/key.pem"));
  return SyncFolder(folder);
}

}  // namespace calib::access
