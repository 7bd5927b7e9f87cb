#include "server/access/authority.h"

#include <arpa/inet.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/return_if_error.h"
#include "server/access/files.h"
#include "server/access/ledger.h"
#include "server/access/signing.h"
#include "server/access/x509.h"

namespace calib::access {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kDay = 86400;            // [s]
constexpr std::int64_t kClocksMayDiffer = 300;  // [s] by which validity begins before now
constexpr int kMostDays = 3650;
constexpr std::int64_t kDaysOfAuthority = 3653;  // ten years, leap days included
constexpr std::size_t kLongestHost = 253;        // RFC 1035
constexpr std::size_t kLongestLabel = 63;

std::int64_t NowUnixSeconds() { return absl::ToUnixSeconds(absl::Now()); }

bool Exists(const std::string& path) {
  std::error_code error;
  return fs::exists(path, error);
}

/// The same folder without a slash at its end or links on the way.
std::string PlainPath(const std::string& folder) {
  std::error_code error;
  fs::path path = fs::weakly_canonical(fs::absolute(folder, error), error);
  if (!path.has_filename()) path = path.parent_path();
  return path.string();
}

struct Authority {
  std::string folder, ca_pem;
  X509Ptr ca;
  KeyPtr key;
  Ledger ledger{};
  std::string crl_pem{};
};

/// Writes crl.pem of the ledger. Its number is the time [us], so that it rises even where the list
/// before is lost.
absl::Status WriteRevocations(Authority& authority, std::int64_t number_before) {
  const std::int64_t now = NowUnixSeconds();
  RevocationList list{
      .revoked = {},
      .number = std::max(absl::ToUnixMicros(absl::Now()), number_before + 1),
      .validity = {.not_before_unix_s = now - kClocksMayDiffer,
                   .not_after_unix_s = UnixSeconds(X509_get0_notAfter(authority.ca.get()))}};
  for (const IssuedCertificate& row : authority.ledger) {
    if (row.revoked_unix_s) list.revoked.push_back(row);
  }
  ASSIGN_OR_RETURN(const CrlPtr crl,
                   SignRevocations(list, authority.ca.get(), authority.key.get()));
  ASSIGN_OR_RETURN(authority.crl_pem, PemOf(crl.get()));
  return ReplaceFile(authority.folder + "/crl.pem", authority.crl_pem, kPublicFile);
}

/// Makes crl.pem say what the ledger says: a kill may have come between the two.
absl::Status CatchUpRevocations(Authority& authority) {
  std::vector<std::string> revoked;
  for (const IssuedCertificate& row : authority.ledger) {
    if (row.revoked_unix_s) revoked.push_back(row.serial);
  }
  std::sort(revoked.begin(), revoked.end());
  auto pem = ReadFile(authority.folder + "/crl.pem");
  const CrlPtr crl = pem.ok() ? ParseRevocations(*pem) : nullptr;
  if (crl && IsIssuedBy(crl.get(), authority.ca.get()) && RevokedSerials(crl.get()) == revoked) {
    authority.crl_pem = *std::move(pem);
    return absl::OkStatus();
  }
  return WriteRevocations(authority, crl ? NumberOf(crl.get()) : 0);
}

absl::StatusOr<Authority> OpenAuthority(const std::string& folder) {
  RETURN_IF_ERROR(CheckIsOwn(folder));
  Authority authority{.folder = folder, .ca_pem = {}, .ca = {}, .key = {}};
  ASSIGN_OR_RETURN(const std::string key_pem, ReadSecret(folder + "/ca-key.pem"));
  ASSIGN_OR_RETURN(authority.ca_pem, ReadFile(folder + "/ca.pem"));
  authority.ca = ParseCertificate(authority.ca_pem);
  authority.key = ParseKey(key_pem);
  if (!authority.ca || !authority.key || !IsKeyOf(authority.key.get(), authority.ca.get())) {
    return absl::FailedPreconditionError(
        absl::StrCat(folder, ": ca.pem and ca-key.pem are not a certificate in PEM and its key: ",
                     "put both back from a copy"));
  }
  ASSIGN_OR_RETURN(authority.ledger, ReadLedger(folder + "/issued.csv"));
  RETURN_IF_ERROR(CatchUpRevocations(authority));
  return authority;
}

absl::Status CheckIsAuthority(const std::string& folder) {
  if (Exists(folder + "/ca-key.pem")) return absl::OkStatus();
  return absl::NotFoundError(absl::StrCat(
      folder, " holds no authority (no ca-key.pem): `calibctl certs init ", folder, "` makes one"));
}

// What is wrong with a name or address of a server; empty: nothing.
std::string ProblemOfHost(const std::string& host) {
  if (IsAddress(host)) return "";
  const auto wrong = [&host](const std::string& why) {
    return absl::StrCat("--host \"", host, "\" ", why);
  };
  const std::vector<std::string> labels = absl::StrSplit(host, '.');
  const bool is_good = host.size() <= kLongestHost &&
                       std::all_of(labels.begin(), labels.end(), [](const std::string& label) {
                         return !label.empty() && label.size() <= kLongestLabel &&
                                label.front() != '-' && label.back() != '-' &&
                                std::all_of(label.begin(), label.end(), [](unsigned char c) {
                                  return absl::ascii_isalnum(c) || c == '-' || c == '_';
                                });
                       });
  const std::string& last = labels.back();
  if (!is_good || std::all_of(last.begin(), last.end(), absl::ascii_isdigit)) {
    return wrong(
        "is neither a host's name, as node1.example.org, nor an address, as 10.0.0.7 or "
        "fd00::7; no port belongs to it");
  }
  return "";
}

absl::Status CheckRequest(const Request& request) {
  std::vector<std::string> problems;
  if (!IsName(request.name)) {
    problems.push_back(
        "NAME is 1 to 64 letters A-Z a-z, digits and . _ @ -, as node7 or "
        "anna@example.org");
  }
  if (request.days < 1 || request.days > kMostDays) {
    problems.push_back(absl::StrCat("--days ", request.days, " is not from 1 to ", kMostDays));
  }
  if (request.role != Role::kServer && !request.hosts.empty()) {
    problems.push_back(absl::StrCat("--host belongs to --role server; a ", NameOf(request.role),
                                    " asks from any host"));
  } else {
    for (const std::string& host : request.hosts) {
      if (std::string problem = ProblemOfHost(host); !problem.empty()) {
        problems.push_back(std::move(problem));
      }
    }
  }
  return problems.empty() ? absl::OkStatus()
                          : absl::InvalidArgumentError(absl::StrJoin(problems, "\n"));
}

// Addresses as they are read back, names in lower case.
std::string PlainHost(const std::string& host) {
  std::array<unsigned char, 16> bytes{};
  std::array<char, INET6_ADDRSTRLEN> text{};
  for (const int family : {AF_INET, AF_INET6}) {
    if (inet_pton(family, host.c_str(), bytes.data()) == 1) {
      return inet_ntop(family, bytes.data(), text.data(), text.size());
    }
  }
  return absl::AsciiStrToLower(host);
}

std::vector<std::string> HostsOfServer(const std::vector<std::string>& asked) {
  std::vector<std::string> hosts;
  const auto add = [&hosts](const std::string& host) {
    if (std::find(hosts.begin(), hosts.end(), host) == hosts.end()) hosts.push_back(host);
  };
  for (const std::string& host : asked) add(PlainHost(host));
  for (const char* const host : {"localhost", "127.0.0.1", "::1"}) add(host);
  return hosts;
}

/// Whom the certificate in `out` is of; none where there is none. FAILED_PRECONDITION where
/// nothing may be written there.
absl::StatusOr<std::optional<Holder>> HolderAt(const std::string& out, const Authority& authority,
                                               const Request& request) {
  const auto refuse = [&out](const std::string& why) {
    return absl::FailedPreconditionError(
        absl::StrCat(out, " ", why, ": choose another folder, as -o ", out, "-2"));
  };
  if (Exists(out + "/ca-key.pem")) return refuse("holds an authority");
  if (Exists(out + "/ca.pem")) {
    const auto pem = ReadFile(out + "/ca.pem");
    const X509Ptr ca = pem.ok() ? ParseCertificate(*pem) : nullptr;
    if (!ca || X509_cmp(ca.get(), authority.ca.get()) != 0) {
      return refuse(absl::StrCat("is of another authority than ", authority.folder));
    }
  }
  if (!Exists(out + "/cert.pem")) return std::optional<Holder>();
  const auto pem = ReadFile(out + "/cert.pem");
  const X509Ptr certificate = pem.ok() ? ParseCertificate(*pem) : nullptr;
  if (!certificate || !IsIssuedBy(certificate.get(), authority.ca.get())) {
    return refuse(absl::StrCat("holds a cert.pem that was not issued by ", authority.folder));
  }
  ASSIGN_OR_RETURN(const Holder holder, HolderOf(certificate.get()));
  if (holder.name != request.name || holder.role != request.role) {
    return refuse(absl::StrCat("holds the certificate of ", holder.name, " (", NameOf(holder.role),
                               ") and can be renewed for nobody else"));
  }
  return std::optional<Holder>(holder);
}

absl::Status CheckRoleOfName(const Authority& authority, const Request& request, std::int64_t now) {
  for (const IssuedCertificate& row : authority.ledger) {
    if (row.name != request.name || row.role == request.role || !row.IsInForce(now)) continue;
    return absl::FailedPreconditionError(
        absl::StrCat(row.name, " has a certificate of role ", NameOf(row.role), " until ",
                     DateOf(row.not_after_unix_s),
                     ", and a name has one role: choose another name, or `calibctl ",
                     "certs revoke ", authority.folder, " ", row.name, "` first"));
  }
  return absl::OkStatus();
}

absl::StatusOr<Validity> ValidityOf(const Authority& authority, int days, std::int64_t now) {
  const std::int64_t end = UnixSeconds(X509_get0_notAfter(authority.ca.get()));
  if (now + days * kDay > end) {
    const std::int64_t left = std::max<std::int64_t>(0, (end - now) / kDay);
    return absl::InvalidArgumentError(
        absl::StrCat("--days ", days, " goes beyond the end of the authority on ", DateOf(end),
                     left > 0 ? absl::StrCat(": at most ", left)
                              : std::string(": `calibctl certs init` makes a new one")));
  }
  return Validity{.not_before_unix_s = now - kClocksMayDiffer,
                  .not_after_unix_s = now + days * kDay};
}

struct Pair {
  std::string cert_pem, key_pem;
};

/// ca.pem stays the same for a folder, so it may come first. From the first rename on the new pair
/// is whole: ReadCredentials knows where the key then is.
absl::Status WriteCredentials(const std::string& out, const Authority& authority,
                              const Pair& pair) {
  ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::TakeItself(out));
  RETURN_IF_ERROR(ReplaceFile(out + "/ca.pem", authority.ca_pem, kPublicFile));
  RETURN_IF_ERROR(ReplaceFile(out + "/crl.pem", authority.crl_pem, kPublicFile));
  RETURN_IF_ERROR(WriteDraft(out + "/key.pem", pair.key_pem, kSecretFile));
  RETURN_IF_ERROR(WriteDraft(out + "/cert.pem", pair.cert_pem, kPublicFile));
  RETURN_IF_ERROR(SyncFolder(out));
  RETURN_IF_ERROR(PutDraft(out + "/cert.pem"));
  RETURN_IF_ERROR(PutDraft(out + "/key.pem"));
  return SyncFolder(out);
}

absl::Status FillAuthority(const std::string& folder) {
  const std::int64_t now = NowUnixSeconds();
  Authority authority{.folder = folder, .ca_pem = {}, .ca = {}, .key = {}};
  ASSIGN_OR_RETURN(authority.key, MakeKey());
  ASSIGN_OR_RETURN(
      authority.ca,
      SignAuthority(authority.key.get(), {.not_before_unix_s = now - kClocksMayDiffer,
                                          .not_after_unix_s = now + kDaysOfAuthority * kDay}));
  ASSIGN_OR_RETURN(authority.ca_pem, PemOf(authority.ca.get()));
  ASSIGN_OR_RETURN(const std::string key_pem, PemOf(authority.key.get()));
  RETURN_IF_ERROR(ReplaceFile(folder + "/ca-key.pem", key_pem, kSecretFile));
  RETURN_IF_ERROR(ReplaceFile(folder + "/ca.pem", authority.ca_pem, kPublicFile));
  RETURN_IF_ERROR(WriteLedger(folder + "/issued.csv", {}));
  return WriteRevocations(authority, 0);
}

absl::Status NotEmpty(const std::string& folder) {
  return absl::AlreadyExistsError(absl::StrCat(
      folder, Exists(folder + "/ca-key.pem") ? " holds an authority already" : " is not empty",
      ": name a folder that is not there yet"));
}

}  // namespace

absl::Status InitAuthority(const std::string& folder) {
  const std::string place = PlainPath(folder);
  std::error_code error;
  if (fs::exists(place, error) &&
      (!fs::is_directory(place, error) || !fs::is_empty(place, error))) {
    return NotEmpty(folder);
  }
  const std::string around = fs::path(place).parent_path().string();
  fs::create_directories(around, error);
  std::string draft = place + ".XXXXXX";
  if (mkdtemp(draft.data()) == nullptr) {  // with mode 0700
    return absl::PermissionDeniedError(
        absl::StrCat(folder, " cannot be made: ", std::generic_category().message(errno)));
  }
  absl::Status made = FillAuthority(draft);
  if (made.ok() && std::rename(draft.c_str(), place.c_str()) != 0) {
    made = errno == ENOTEMPTY || errno == EEXIST
               ? NotEmpty(folder)
               : absl::PermissionDeniedError(absl::StrCat(
                     folder, " cannot be made: ", std::generic_category().message(errno)));
  }
  if (made.ok()) return SyncFolder(around);
  fs::remove_all(draft, error);
  return made;
}

absl::StatusOr<std::int64_t> EndOfAuthority(const std::string& folder) {
  ASSIGN_OR_RETURN(const Trust trust, ReadTrust(folder));
  return UnixSeconds(X509_get0_notAfter(trust.ca.get()));
}

absl::StatusOr<Holder> Issue(const std::string& authority_folder, const Request& request,
                             const std::string& out_folder) {
  const std::string authority = PlainFolder(authority_folder);
  const std::string out = PlainFolder(out_folder);
  RETURN_IF_ERROR(CheckRequest(request));
  RETURN_IF_ERROR(CheckIsAuthority(authority));
  ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::Take(authority));
  ASSIGN_OR_RETURN(Authority it, OpenAuthority(authority));
  const std::int64_t now = NowUnixSeconds();
  ASSIGN_OR_RETURN(const Validity validity, ValidityOf(it, request.days, now));
  ASSIGN_OR_RETURN(const auto before, HolderAt(out, it, request));
  RETURN_IF_ERROR(CheckRoleOfName(it, request, now));
  const bool keeps_hosts = request.hosts.empty() && before.has_value();
  Leaf leaf{.name = request.name, .role = request.role, .hosts = {}, .validity = validity};
  if (request.role == Role::kServer) {
    leaf.hosts = HostsOfServer(keeps_hosts ? before->hosts : request.hosts);
  }
  ASSIGN_OR_RETURN(const KeyPtr key, MakeKey());
  ASSIGN_OR_RETURN(const X509Ptr certificate, SignLeaf(leaf, key.get(), it.ca.get(), it.key.get()));
  ASSIGN_OR_RETURN(const Holder holder, HolderOf(certificate.get()));
  Pair pair;
  ASSIGN_OR_RETURN(pair.cert_pem, PemOf(certificate.get()));
  ASSIGN_OR_RETURN(pair.key_pem, PemOf(key.get()));
  RETURN_IF_ERROR(MakeOwnFolder(out));
  RETURN_IF_ERROR(FinishRenewal(out));  // before its drafts are written over
  // The ledger comes first: what is not in it could not be revoked.
  it.ledger.push_back({.serial = holder.serial,
                       .name = holder.name,
                       .role = holder.role,
                       .not_after_unix_s = holder.not_after_unix_s});
  RETURN_IF_ERROR(WriteLedger(authority + "/issued.csv", it.ledger));
  RETURN_IF_ERROR(WriteCredentials(out, it, pair));
  return holder;
}

absl::StatusOr<int> Revoke(const std::string& authority_folder, const std::string& name) {
  const std::string authority = PlainFolder(authority_folder);
  RETURN_IF_ERROR(CheckIsAuthority(authority));
  ASSIGN_OR_RETURN(const FolderLock lock, FolderLock::Take(authority));
  ASSIGN_OR_RETURN(Authority it, OpenAuthority(authority));
  const std::int64_t now = NowUnixSeconds();
  bool is_known = false;
  int revoked = 0;
  for (IssuedCertificate& row : it.ledger) {
    if (row.name != name) continue;
    is_known = true;
    if (!row.IsInForce(now)) continue;
    row.revoked_unix_s = now;
    ++revoked;
  }
  if (!is_known) {
    return absl::NotFoundError(absl::StrCat(authority, " has issued no certificate to \"", name,
                                            "\"; issued.csv names all holders"));
  }
  if (revoked == 0) return 0;
  RETURN_IF_ERROR(WriteLedger(authority + "/issued.csv", it.ledger));
  RETURN_IF_ERROR(CatchUpRevocations(it));
  return revoked;
}

}  // namespace calib::access
