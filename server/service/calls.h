#pragma once
// Calls as they begin and end: each holds its pass of the door (door.h) until gRPC is done with it,
// and one that is turned away ends at once with a status.

#include <grpcpp/support/server_callback.h>
#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/fit_message.h"
#include "proto/rpc/status.h"
#include "server/service/door.h"

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

/// The pass of a call whose first message is `request`, if it may come in.
inline absl::StatusOr<Door::Pass> Admit(Door& door, const std::string& peer,
                                        const google::protobuf::Message& request) {
  auto pass = door.Enter(peer);
  if (pass.ok()) {
    if (absl::Status status = door.Check(peer, request); !status.ok()) {
      return status;
    }
  }
  return pass;
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

}  // namespace calib::service
