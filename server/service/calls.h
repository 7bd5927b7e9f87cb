#pragma once
// Calls as they begin and end: each is let in by the guard (guard.h), holds its pass of the door
// (door.h) until gRPC is done with it, and one that is turned away ends at once with a status.

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>
#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/fit_message.h"
#include "proto/rpc/status.h"
#include "server/service/core.h"

namespace calib::service {

/// A call with one answer; whoever it was made for calls Finish() once. Deletes itself.
class UnaryCall final : public grpc::ServerUnaryReactor {
 public:
  explicit UnaryCall(Door::Pass pass) : pass_(std::move(pass)) {}
  void OnDone() override { delete this; }

 private:
  const Door::Pass pass_;
};

/// A call of any kind that was turned away. Deletes itself.
template <typename Reactor>
class EndedCall final : public Reactor {
 public:
  explicit EndedCall(const absl::Status& why) { this->Finish(rpc::ToGrpc(why)); }
  void OnDone() override { delete this; }
};

/// A call that has come in: its pass, and whose it is.
struct Entry {
  Door::Pass pass;
  Caller caller;
};

/// Says in the log who did what, once it is done.
inline void LogChange(const std::string& what, const std::string& of, const Caller& caller) {
  spdlog::info("change what={} of={} by={} role={}", what, of, caller.name,
               access::NameOf(caller.role));
}

/// Lets a call in: its caller has the right (guard.h), the door has room for it, and its first
/// message, if it has come with one, keeps its rules. What is turned away is logged.
inline absl::StatusOr<Entry> Admit(Core& core, const grpc::ServerContextBase& context, Right right,
                                   const google::protobuf::Message* request) {
  const std::string peer = context.peer();
  auto caller = core.guard().Admit(context, right);
  if (!caller.ok()) {
    core.door().LogRefusal(peer, caller.status());
    return caller.status();
  }
  ASSIGN_OR_RETURN(auto pass, core.door().Enter(peer));
  if (request != nullptr) {
    RETURN_IF_ERROR(core.door().Check(peer, *request));
  }
  return Entry{.pass = std::move(pass), .caller = *std::move(caller)};
}

/// The same of a call that carries a content.
inline absl::StatusOr<Entry> AdmitWithBlob(Core& core, const grpc::ServerContextBase& context,
                                           Right right, const google::protobuf::Message* request) {
  ASSIGN_OR_RETURN(Entry entry, Admit(core, context, right, request));
  entry.pass.reset();
  ASSIGN_OR_RETURN(entry.pass, core.door().EnterWithBlob(context.peer()));
  return entry;
}

/// An answer as it leaves: its texts cut to what their rules allow. DATA_LOSS, and logged, where it
/// breaks another rule even so: what is stored was written by a program without rules.
template <typename Reply>
absl::StatusOr<Reply> Outgoing(absl::StatusOr<Reply> reply) {
  if (reply.ok()) {
    rpc::FitTexts(*reply);
    if (const absl::Status status = rpc::CheckMessage(*reply); !status.ok()) {
      spdlog::error("answer_withheld reason=\"{}\"", std::string(status.message()));
      return absl::DataLossError(absl::StrCat("what is stored cannot be told: ", status.message()));
    }
  }
  return reply;
}

/// Ends a call with its answer, or with why there is none.
template <typename Reply>
void Answer(grpc::ServerUnaryReactor* reactor, absl::StatusOr<Reply> answer, Reply* reply) {
  auto outgoing = Outgoing(std::move(answer));
  const absl::Status status = outgoing.status();
  if (status.ok()) {
    *reply = *std::move(outgoing);
  }
  reactor->Finish(rpc::ToGrpc(status));
}

}  // namespace calib::service
