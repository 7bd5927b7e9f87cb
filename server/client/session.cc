#include "server/client/session.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <thread>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/address.h"
#include "server/messages/read_words.h"
#include "server/service/server.h"
#include "server/service/state_folder.h"

namespace calib::client {

using campaign::CampaignState;

namespace {

constexpr std::chrono::seconds kShutdown{3};
constexpr std::chrono::milliseconds kBetweenTries{100};

absl::Status CheckHoldsState(const std::string& folder) {
  std::error_code error;
  if (std::filesystem::exists(std::filesystem::path(folder) / "calib.db", error)) {
    return absl::OkStatus();
  }
  if (error == std::errc::permission_denied) {
    return absl::PermissionDeniedError(
        absl::StrCat(folder, " may not be entered by this account: it is another's"));
  }
  return absl::InvalidArgumentError(absl::StrCat(
      folder, " holds no state of a server; `calibctl run` and `calibctl submit` make one"));
}

// The last error that a log has; without one its last line.
std::string LastWords(const std::string& path) {
  std::ifstream file(path);
  std::string last;
  std::string last_error;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty()) last = line;
    if (absl::StrContains(line, " error ")) last_error = line;
  }
  return last_error.empty() ? last : last_error;
}

int CoresOfThisMachine() {
  return static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

}  // namespace

Session::Session() = default;

absl::StatusOr<std::unique_ptr<Session>> Session::Open(const ServerChoice& choice,
                                                       bool may_create) {
  std::unique_ptr<Session> session(new Session());
  session->choice_ = choice;
  session->address_ = choice.address;
  if (!choice.state.empty()) {
    if (!may_create) RETURN_IF_ERROR(CheckHoldsState(choice.state));
    session->state_ = choice.state;
    RETURN_IF_ERROR(session->ServeOrJoin());
  } else {
    ASSIGN_OR_RETURN(auto client,
                     Client::Connect(session->address_, session->AccessAt(session->address_)));
    session->client_ = std::move(client);
  }
  if (choice.workers.value_or(0) > 0) {
    if (choice.state.empty()) {
      return absl::InvalidArgumentError(
          "--workers goes with --state DIR; workers of a remote server are calib-worker --server");
    }
    RETURN_IF_ERROR(session->UseWorkers(choice.workers));
  }
  return session;
}

rpc::AccessChoice Session::AccessAt(const std::string& address) const {
  rpc::AccessChoice access{.tls = choice_.tls, .token = choice_.token};
  const std::string own = state_ + "/token";
  if (!state_.empty() && access.tls.empty() && access.token.empty() &&
      rpc::SocketPathOf(address).empty() && rpc::IsLoopback(address) && rpc::ReadToken(own).ok()) {
    access.token = own;
    access.is_own = true;
  }
  return access;
}

bool Session::shows_certificate() const {
  const auto access = rpc::FindAccess(address_, AccessAt(address_));
  return access.ok() && !access->tls.empty();
}

absl::StatusOr<std::string> Session::ServeOrFind() {
  constexpr int kTries = 5;
  service::ServerOptions options;
  options.state_dir = state_;
  options.listen = "";  // a socket of this account
  options.log_file = (std::filesystem::path(state_) / "server.log").string();
  options.on_failure = [failure = failure_](const absl::Status& status) {
    absl::MutexLock lock(&failure->mutex);
    failure->status = status;
  };
  absl::Status last;
  for (int i = 0; i < kTries; ++i) {
    auto server = service::Server::Start(options);
    if (server.ok()) {
      server_ = *std::move(server);
      return server_->address();
    }
    if (!absl::IsAlreadyExists(server.status())) return server.status();
    auto address = service::ServingAddress(state_);
    if (address.ok() || absl::IsPermissionDenied(address.status())) return address;
    last = address.status();
    std::this_thread::sleep_for(kBetweenTries);
  }
  return last;
}

absl::Status Session::ServeOrJoin() {
  constexpr int kTries = 3;
  absl::Status last;
  for (int i = 0; i < kTries && client_ == nullptr; ++i) {
    ASSIGN_OR_RETURN(auto address, ServeOrFind());
    address_ = std::move(address);
    auto client = Client::Connect(address_, AccessAt(address_));
    last = client.status();
    if (client.ok()) client_ = *std::move(client);
    if (server_ != nullptr) break;
  }
  host_stays_ = is_guest() && service::IsServedForGood(state_);
  if (client_ != nullptr) {
    client_->OnLoss([this] {
      const std::string address = TakeOverOrFind();
      return Client::Place{.address = address, .access = AccessAt(address)};
    });
  }
  return last;
}

std::string Session::TakeOverOrFind() {
  if (!failure_->Get().ok()) return "";
  if (server_ != nullptr) return address_;  // it is not gone, only slow
  if (host_stays_) {
    const auto address = service::ServingAddress(state_);  // until somebody has started it again
    if (address.ok()) address_ = *address;
    return address_;
  }
  auto address = ServeOrFind();
  if (absl::IsUnavailable(address.status())) return address_;  // somebody is about to serve it
  if (!address.ok()) return GiveUp(address.status());
  const bool moved = *address != address_;
  address_ = *std::move(address);
  auto count = static_cast<int>(workers_.size());
  if (moved) workers_.clear();  // they look for it elsewhere
  if (server_ != nullptr && count == 0) count = workers_as_host_;
  if (server_ != nullptr) {
    std::cerr << "the process that served " << state_ << " has ended; this one serves it now, with "
              << count << " worker(s)\n";
  }
  if (workers_.empty()) {
    if (auto started = StartWorkers(count); !started.ok()) return GiveUp(started);
  }
  return address_;
}

std::string Session::GiveUp(const absl::Status& why) {
  absl::MutexLock lock(&failure_->mutex);
  failure_->status = why;
  return "";
}

Session::~Session() {
  const bool nothing_rests = server_ != nullptr && !workers_.empty() && AllEnded();
  client_.reset();
  for (ChildProcess& worker : workers_) worker.AskToStop();
  workers_.clear();
  if (server_ != nullptr) server_->Shutdown(kShutdown);
  if (nothing_rests) {
    std::error_code ignored;
    std::filesystem::remove_all(Checkpoints(), ignored);
  }
}

bool Session::AllEnded() {
  if (client_ == nullptr) return false;
  const auto campaigns = client_->List();
  return campaigns.ok() &&
         std::all_of(campaigns->begin(), campaigns->end(), [](const v1::CampaignStatus& c) {
           const auto state = messages::StateOf(c);
           return state == CampaignState::kFinished || state == CampaignState::kCancelled;
         });
}

std::string Session::Checkpoints() const {
  return (std::filesystem::path(state_) / "checkpoints").string();
}

absl::Status Session::UseWorkers(std::optional<int> count) {
  if (!count) {
    workers_as_host_ = CoresOfThisMachine();
  }
  return StartWorkers(count.value_or(is_guest() ? 0 : workers_as_host_));
}

absl::Status Session::StartWorkers(int count) {
  if (count == 0) return absl::OkStatus();
  ASSIGN_OR_RETURN(const auto program, FindWorkerProgram());
  for (int i = 1; i <= count; ++i) {
    const std::string log =
        (std::filesystem::path(state_) / absl::StrCat("worker-", i, ".log")).string();
    std::vector<std::string> arguments{"--server",
                                       address_,
                                       "--slots",
                                       "1",
                                       "--threads",  // a run that wants several gets them
                                       absl::StrCat(CoresOfThisMachine()),
                                       "--name",
                                       absl::StrCat("local-", getpid(), "-", i),
                                       "--checkpoints",
                                       Checkpoints(),
                                       "--allow-command",  // what the user's own file names
                                       "*",
                                       "--exit-with-parent",
                                       absl::StrCat(getpid())};
    const rpc::AccessChoice access = AccessAt(address_);
    if (!access.tls.empty()) arguments.insert(arguments.end(), {"--tls", access.tls});
    if (!access.token.empty()) arguments.insert(arguments.end(), {"--token", access.token});
    ASSIGN_OR_RETURN(auto worker, ChildProcess::Start(program, arguments, log));
    workers_.push_back(std::move(worker));
  }
  return absl::OkStatus();
}

absl::Status Session::Check() {
  RETURN_IF_ERROR(failure_->Get());
  if (workers_.empty()) return absl::OkStatus();
  for (ChildProcess& worker : workers_) {
    if (!worker.Poll()) return absl::OkStatus();
  }
  const std::string log = (std::filesystem::path(state_) / "worker-1.log").string();
  return absl::FailedPreconditionError(absl::StrCat("all local workers have ended with status ",
                                                    *workers_.front().Poll(), "; ", log,
                                                    " says: ", LastWords(log)));
}

}  // namespace calib::client
