#pragma once
// Who calls, and what they may do. A certificate says its holder's name and role; a token, and the
// socket of an embedded server, are those of the account that runs the server, who operates it.

#include <cstdint>
#include <memory>
#include <set>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "server/access/certificate.h"
#include "server/access/role.h"

namespace grpc {
class ServerContextBase;
}

namespace calib::service {

/// What a call is for. Roles have: worker kWork; viewer kRead; submitter kRead and kChange, of its
/// own campaigns; operator all, of all campaigns.
enum class Right { kRead, kChange, kOperate, kWork };

struct Caller {
  std::string name{};
  access::Role role = access::Role::kViewer;
  std::string certificate{};  ///< PEM; empty: it came with a token or over a socket
  std::string peer{};         ///< as gRPC names the connection

  friend bool operator==(const Caller&, const Caller&) = default;
};

/// Thread-safe.
class Guard {
 public:
  /// tls: folder of the server's certificate; empty: none. token: what callers without a
  /// certificate must show unless they come over a socket; empty: nothing, for callers of this very
  /// process. account: whose server it is. inside: what this very process shows to read
  /// over Server::InProcessChannel(), whatever others must show; empty: nobody does.
  static absl::StatusOr<std::unique_ptr<Guard>> Open(const std::string& tls, std::string token,
                                                     std::string account, std::string inside = "");

  /// UNAUTHENTICATED: nothing that is known was shown. PERMISSION_DENIED: the caller's role lacks
  /// the right. Each a sentence, with what would be right.
  absl::StatusOr<Caller> Admit(const grpc::ServerContextBase& context, Right right);
  /// Whether one who came in may stay, hours later: a certificate that has ended or was revoked
  /// since may not. Judges each certificate once a second, however often it is asked.
  absl::Status Recheck(const Caller& caller);

  /// PERMISSION_DENIED: a submitter, of a campaign that is somebody else's.
  static absl::Status MayChange(const Caller& caller, const std::string& campaign,
                                const std::string& owner);

 private:
  Guard(std::unique_ptr<access::Verifier> verifier, std::string token, std::string account,
        std::string inside);
  absl::StatusOr<Caller> Identify(const grpc::ServerContextBase& context);

  const std::unique_ptr<access::Verifier> verifier_;  // nullptr: no certificates
  const std::string token_;
  const std::string account_;
  const std::string inside_;
  absl::Mutex mutex_;
  std::int64_t judged_unix_s_ ABSL_GUARDED_BY(mutex_) = 0;
  std::set<std::string> good_ ABSL_GUARDED_BY(mutex_);  // certificates, judged in that second
};

/// The name of the account that this process runs under, its number where it has none.
std::string AccountName();

}  // namespace calib::service
