#pragma once
// A blocking client of the Campaigns service, as tests need it. No gRPC header is needed to use it.

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "calib/v1/worker.pb.h"
#include "proto/rpc/access.h"

namespace calib::testing {

class Client {
 public:
  /// access: what is shown there.
  explicit Client(const std::string& address, const rpc::AccessChoice& access = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  absl::Status PutBlob(const std::string& content);
  absl::StatusOr<v1::SubmitReply> Submit(const v1::SubmitRequest& request);
  /// Puts the files (path -> content) and submits the campaign.
  absl::StatusOr<std::string> SubmitCampaign(const std::string& yaml,
                                             const std::map<std::string, std::string>& files,
                                             const std::string& request_id);
  absl::StatusOr<v1::CampaignStatus> AddRuns(const v1::AddRunsRequest& request);
  absl::StatusOr<v1::CampaignStatus> Show(const std::string& campaign);
  absl::StatusOr<v1::ListReply> List();
  absl::StatusOr<v1::Posterior> Posterior(const std::string& campaign);
  absl::StatusOr<std::vector<v1::Sample>> Samples(const std::string& campaign);
  absl::StatusOr<std::vector<v1::SampleStates>> States(const std::string& campaign);
  absl::StatusOr<std::vector<v1::LogEntry>> Log(const std::string& campaign);
  absl::StatusOr<v1::WorkerList> Workers();
  absl::StatusOr<v1::WorkerInfo> Drain(const std::string& worker,
                                       std::chrono::milliseconds within = {});
  absl::StatusOr<v1::ServerReport> Examine();
  absl::StatusOr<v1::CampaignStatus> Pause(const v1::ControlRequest& request);
  absl::StatusOr<v1::CampaignStatus> Resume(const v1::ControlRequest& request);
  absl::StatusOr<v1::CampaignStatus> Cancel(const v1::ControlRequest& request);
  absl::Status Delete(const v1::ControlRequest& request);
  /// Every status of Watch until it ends.
  absl::StatusOr<std::vector<v1::CampaignStatus>> Watch(const std::string& campaign,
                                                        std::chrono::milliseconds limit);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A worker without mechanics: says what a test tells it to say.
class FakeWorker {
 public:
  /// Opens the stream; the first message up is `hello`.
  FakeWorker(const std::string& address, const v1::Hello& hello);
  ~FakeWorker();

  bool Send(const v1::WorkerMessage& message);
  /// The next message down; empty when the stream has ended or after `limit`.
  std::optional<v1::ServerMessage> Receive(std::chrono::milliseconds limit);
  /// The next message of this kind, others skipped.
  std::optional<v1::ServerMessage> Receive(v1::ServerMessage::MessageCase kind,
                                           std::chrono::milliseconds limit);
  /// Status with which the server ended the stream.
  absl::Status Finish();
  /// Cuts the stream without a word.
  void Cut();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Hello of a worker that fits this build; all of one name are one process.
v1::Hello MatchingHello(const std::string& name, int slots);

}  // namespace calib::testing
