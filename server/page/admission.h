#pragma once
// Who may look: who shows the token of the state folder, or a certificate whose role may read.

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "server/access/certificate.h"
#include "server/page/http_message.h"
#include "server/page/target.h"

namespace calib::page {

/// Thread-safe.
class Admission {
 public:
  /// token: of the state folder. tls: folder of the server's certificate, against whose authority
  /// those of peers are judged; empty: none. Errors: those of access::Verifier::Open.
  static absl::StatusOr<std::unique_ptr<Admission>> Open(const std::string& token,
                                                         const std::string& tls);

  /// The cookie is this page's, not another's at another port of the same host.
  void SetPort(int port) { cookie_name_ = "calib-" + std::to_string(port); }

  /// Whether a request may see the page and its documents. UNAUTHENTICATED: it shows nothing that
  /// is known; PERMISSION_DENIED: its certificate's role may not read.
  absl::Status Admit(const HttpRequest& request) const;

  /// Of a request whose target holds the right token: the value of Set-Cookie that lets its browser
  /// in from now on. The cookie is not the token: it opens the page alone.
  std::optional<std::string> CookieFor(const Target& target) const;

 private:
  Admission(std::string token, std::unique_ptr<access::Verifier> verifier);
  absl::Status JudgeCertificate(const std::string& pem) const;

  const std::string token_;
  const std::string cookie_;  // value
  const std::unique_ptr<access::Verifier> verifier_;
  std::string cookie_name_ = "calib";
};

/// Whether the HOST of a request (HostIn) is a name of this machine alone, as that of a page that
/// is served to it must be: another name that leads here is somebody's who wants to read it from
/// another page (DNS rebinding).
bool IsNameOfThisMachine(const std::string& host);

}  // namespace calib::page
