#include "server/page/admission.h"

#include <chrono>
#include <string_view>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/address.h"
#include "proto/rpc/digest.h"
#include "server/access/secret.h"

namespace calib::page {
namespace {

using access::Role;

bool MayRead(Role role) {
  return role == Role::kViewer || role == Role::kSubmitter || role == Role::kOperator;
}

std::string BearerIn(const std::string& authorization) {
  constexpr std::string_view kScheme = "Bearer ";
  return absl::StartsWithIgnoreCase(authorization, std::string(kScheme))
             ? authorization.substr(kScheme.size())
             : "";
}

std::int64_t UnixNow() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

absl::StatusOr<std::unique_ptr<Admission>> Admission::Open(const std::string& token,
                                                           const std::string& tls) {
  std::unique_ptr<access::Verifier> verifier;
  if (!tls.empty()) {
    ASSIGN_OR_RETURN(verifier, access::Verifier::Open(tls));
  }
  return std::unique_ptr<Admission>(new Admission(token, std::move(verifier)));
}

Admission::Admission(std::string token, std::unique_ptr<access::Verifier> verifier)
    : token_(std::move(token)),
      cookie_(rpc::Sha256Hex("cookie of the page " + token_)),
      verifier_(std::move(verifier)) {}

absl::Status Admission::JudgeCertificate(const std::string& pem) const {
  ASSIGN_OR_RETURN(const auto holder, verifier_->Verify(pem, UnixNow()));
  if (MayRead(holder.role)) return absl::OkStatus();
  return absl::PermissionDeniedError(
      absl::StrCat(holder.name, " has the role ", access::NameOf(holder.role),
                   ", and the page is for the roles viewer, submitter and operator"));
}

absl::Status Admission::Admit(const HttpRequest& request) const {
  if (access::IsSameSecret(BearerIn(request.authorization), token_) ||
      access::IsSameSecret(CookieIn(request.cookie, cookie_name_), cookie_)) {
    return absl::OkStatus();
  }
  if (verifier_ != nullptr && !request.certificate.empty()) {
    return JudgeCertificate(request.certificate);
  }
  return absl::UnauthenticatedError(absl::StrCat(
      "this page wants the token of its server: open the address that `calibctl page` prints, or "
      "add ?token= and what stands in `token` of the server's state folder",
      verifier_ != nullptr ? "; or show a certificate of its authority" : ""));
}

std::optional<std::string> Admission::CookieFor(const Target& target) const {
  const auto shown = target.query.find("token");
  if (shown == target.query.end() || !access::IsSameSecret(shown->second, token_)) {
    return std::nullopt;
  }
  return absl::StrCat(cookie_name_, "=", cookie_, "; Path=/; HttpOnly; SameSite=Strict",
                      verifier_ != nullptr ? "; Secure" : "");
}

bool IsNameOfThisMachine(const std::string& host) {
  const std::string address = host + ":1";
  return rpc::SocketPathOf(address).empty() && rpc::IsLoopback(address);
}

}  // namespace calib::page
