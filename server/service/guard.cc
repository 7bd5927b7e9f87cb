#include "server/service/guard.h"

#include <grpc/grpc_security_constants.h>
#include <grpcpp/security/auth_context.h>
#include <grpcpp/server_context.h>
#include <pwd.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/access/secret.h"

namespace calib::service {
namespace {

using access::Role;

constexpr std::size_t kLongestPasswordEntry = 16384;

bool Has(Role role, Right right) {
  switch (role) {
    case Role::kOperator:
      return true;
    case Role::kSubmitter:
      return right == Right::kRead || right == Right::kChange;
    case Role::kViewer:
      return right == Right::kRead;
    case Role::kWorker:
      return right == Right::kWork;
    case Role::kServer:
      return false;
  }
  return false;
}

const char* WhatTheyMay(Role role) {
  switch (role) {
    case Role::kOperator:
      return "do all";
    case Role::kSubmitter:
      return "read, submit, and change campaigns of their own";
    case Role::kViewer:
      return "read";
    case Role::kWorker:
      return "only take runs and report them";
    case Role::kServer:
      return "only serve";
  }
  return "";
}

const char* RoleThatHas(Right right) {
  switch (right) {
    case Right::kRead:
      return "viewer";
    case Right::kChange:
      return "submitter";
    case Right::kOperate:
      return "operator";
    case Right::kWork:
      return "worker";
  }
  return "";
}

std::int64_t UnixSeconds() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// The token of `authorization: Bearer TOKEN`; empty: none was shown.
std::string ShownToken(const grpc::ServerContextBase& context) {
  constexpr std::string_view kScheme = "Bearer ";
  const auto found = context.client_metadata().find("authorization");
  if (found == context.client_metadata().end()) {
    return "";
  }
  const std::string value(found->second.data(), found->second.size());
  return value.starts_with(kScheme) ? value.substr(kScheme.size()) : "";
}

}  // namespace

std::string AccountName() {
  std::array<char, kLongestPasswordEntry> buffer{};
  passwd entry{};
  passwd* found = nullptr;
  getpwuid_r(geteuid(), &entry, buffer.data(), buffer.size(), &found);
  return found != nullptr ? std::string(found->pw_name) : std::to_string(geteuid());
}

absl::StatusOr<std::unique_ptr<Guard>> Guard::Open(const std::string& tls, std::string token,
                                                   std::string account, std::string inside) {
  std::unique_ptr<access::Verifier> verifier;
  if (!tls.empty()) {
    ASSIGN_OR_RETURN(verifier, access::Verifier::Open(tls));
  }
  return std::unique_ptr<Guard>(
      new Guard(std::move(verifier), std::move(token), std::move(account), std::move(inside)));
}

Guard::Guard(std::unique_ptr<access::Verifier> verifier, std::string token, std::string account,
             std::string inside)
    : verifier_(std::move(verifier)),
      token_(std::move(token)),
      account_(std::move(account)),
      inside_(std::move(inside)) {}

absl::StatusOr<Caller> Guard::Identify(const grpc::ServerContextBase& context) {
  if (!inside_.empty() && access::IsSameSecret(ShownToken(context), inside_)) {
    return Caller{.name = account_, .role = Role::kViewer};
  }
  if (verifier_ != nullptr) {
    const auto shown = context.auth_context()->FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
    if (shown.empty()) {
      return absl::UnauthenticatedError(
          "no certificate was shown: this server wants one of its authority (--tls DIR)");
    }
    Caller caller{.certificate = std::string(shown.front().data(), shown.front().size())};
    ASSIGN_OR_RETURN(const auto holder, verifier_->Verify(caller.certificate, UnixSeconds()));
    caller.name = holder.name;
    caller.role = holder.role;
    return caller;
  }
  // Only the account of the server reaches its socket (listener.h).
  if (!token_.empty() && !context.peer().starts_with("unix:")) {
    const std::string token = ShownToken(context);
    if (token.empty()) {
      return absl::UnauthenticatedError(
          "no token was shown: programs of the account that runs the server find it by "
          "themselves, others are given it by --token FILE or $CALIB_TOKEN (it stands in `token` "
          "of the server's state folder)");
    }
    if (!access::IsSameSecret(token, token_)) {
      return absl::UnauthenticatedError(
          "the token is not this server's, which stands in `token` of its state folder (--token "
          "FILE or $CALIB_TOKEN)");
    }
  }
  return Caller{.name = account_, .role = Role::kOperator};
}

absl::StatusOr<Caller> Guard::Admit(const grpc::ServerContextBase& context, Right right) {
  ASSIGN_OR_RETURN(Caller caller, Identify(context));
  if (!Has(caller.role, right)) {
    return absl::PermissionDeniedError(absl::StrCat(
        caller.name, " has the role ", access::NameOf(caller.role), ", whose holders may ",
        WhatTheyMay(caller.role), "; this needs the role ", RoleThatHas(right)));
  }
  caller.peer = context.peer();
  return caller;
}

absl::Status Guard::Recheck(const Caller& caller) {
  if (verifier_ == nullptr || caller.certificate.empty()) {  // of this account, or this process
    return absl::OkStatus();
  }
  const std::int64_t now = UnixSeconds();
  {
    absl::MutexLock lock(&mutex_);
    if (std::exchange(judged_unix_s_, now) != now) {
      good_.clear();
    }
    if (good_.contains(caller.certificate)) {
      return absl::OkStatus();
    }
  }
  absl::Status status = verifier_->Verify(caller.certificate, now).status();
  if (status.ok()) {
    absl::MutexLock lock(&mutex_);
    if (judged_unix_s_ == now) {
      good_.insert(caller.certificate);
    }
  }
  return status;
}

absl::Status Guard::MayChange(const Caller& caller, const std::string& campaign,
                              const std::string& owner) {
  if (caller.role == Role::kOperator || caller.name == owner) {
    return absl::OkStatus();
  }
  return absl::PermissionDeniedError(absl::StrCat(
      campaign, " belongs to ", owner.empty() ? "nobody that is known" : owner, ", and ",
      caller.name, " is a submitter: its owner or an operator may change it"));
}

}  // namespace calib::service
