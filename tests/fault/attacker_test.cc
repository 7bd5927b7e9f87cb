// A scripted attacker: everything that a peer can send, and more of it than anybody needs. The
// server lives, its memory grows by less than 64 MiB, and `show` answers within half a second all
// the while.
#include "tests/support/attacker.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <limits>
#include <thread>

#include "calib/v1/campaign.pb.h"
#include "proto/rpc/digest.h"
#include "tests/support/broken_messages.h"
#include "tests/support/deployment.h"
#include "tests/support/small_campaign.h"

namespace calib::testing {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::int64_t kMostGrowth = std::int64_t{64} << 20;  // bytes
constexpr milliseconds kSlowestShow{500};
/// AddressSanitizer keeps what was freed and takes several times as long: neither is the server's.
#ifdef __SANITIZE_ADDRESS__
constexpr bool kHasBounds = false;
#else
constexpr bool kHasBounds = true;
#endif
constexpr seconds kAnswered{20};

/// Resident memory of a process [bytes]; 0: it is gone.
std::int64_t MemoryOf(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/statm");
  std::int64_t all = 0;
  std::int64_t resident = 0;
  file >> all >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

/// Asks for the status of c1 over and over, and looks at the server's memory, until it goes.
class Watch {
 public:
  explicit Watch(Deployment& deployment)
      : client_(deployment.client()), server_(deployment.server().id()) {
    for (int k = 0; k < 20; ++k) (void)client_.Show("c1");
    before_ = MemoryOf(server_);
    most_ = before_;
    thread_ = std::jthread([this](std::stop_token stop) {
      while (!stop.stop_requested()) {
        const auto asked = std::chrono::steady_clock::now();
        const bool answered = client_.Show("c1").ok();
        slowest_ = std::max(slowest_, std::chrono::duration_cast<milliseconds>(
                                          std::chrono::steady_clock::now() - asked));
        unanswered_ += answered ? 0 : 1;
        ++times_;
        most_ = std::max(most_, MemoryOf(server_));
        std::this_thread::sleep_for(milliseconds(10));
      }
    });
  }

  /// Says what was seen and holds it to the bounds.
  void End(const std::string& attack) {
    thread_.request_stop();
    thread_.join();
    std::printf("%s: %d shows, slowest %lld ms; memory %.1f MiB, grew by %.1f MiB\n",
                attack.c_str(), times_, static_cast<long long>(slowest_.count()),
                static_cast<double>(before_) / (1 << 20),
                static_cast<double>(most_ - before_) / (1 << 20));
    EXPECT_GT(before_, 0);
    EXPECT_EQ(unanswered_, 0) << attack;
    if (kHasBounds) {
      EXPECT_LE(slowest_, kSlowestShow) << attack;
      EXPECT_LT(most_ - before_, kMostGrowth) << attack;
    }
    EXPECT_GT(MemoryOf(server_), 0) << attack << ": the server has ended";
  }

 private:
  Client client_;
  const pid_t server_;
  std::int64_t before_ = 0;
  std::int64_t most_ = 0;
  milliseconds slowest_{0};
  int times_ = 0;
  int unanswered_ = 0;
  std::jthread thread_;
};

class Attack : public ::testing::Test {
 protected:
  explicit Attack(DeploymentOptions options = {.name = "attack", .lease_ms = 20000})
      : deployment_(std::move(options)) {}

  void SetUp() override {
    ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
    client_ = deployment_.client();
    campaign_ = MakeSmallCampaign({.samples = 8, .max_iterations = 1, .load_steps = 2});
    ASSERT_TRUE(client_.SubmitCampaign(campaign_.yaml, campaign_.files, "r").ok());
    watch_ = std::make_unique<Watch>(deployment_);
  }

  void TearDown() override {
    if (HasFailure()) std::printf("%s\n", deployment_.Logs().c_str());
  }

  void End(const std::string& attack) {
    watch_->End(attack);
    EXPECT_TRUE(deployment_.server().Running());
    EXPECT_TRUE(client_.List().ok());
  }

  /// Lines of the server's log that say that something was refused.
  int LinesOfRefusals() const {
    const std::string logs = deployment_.Logs();
    int lines = 0;
    for (std::size_t at = logs.find(" refused peer="); at != std::string::npos;
         at = logs.find(" refused peer=", at + 1)) {
      ++lines;
    }
    return lines;
  }

  Deployment deployment_;
  Client client_{"unused:0"};  // the server's once it runs
  SmallCampaign campaign_;
  std::unique_ptr<Watch> watch_;
};

TEST_F(Attack, EachRuleOfEachRequestIsBrokenAndAnsweredWithAStatus) {
  const auto* service = v1::SubmitRequest::descriptor()->file()->service(0);
  int broken = 0;
  int kept = 0;
  Attacker attacker(deployment_.address());
  for (int k = 0; k < service->method_count(); ++k) {
    const auto& method = *service->method(k);
    if (method.name() == "Watch") continue;  // of a campaign that goes on it has no end
    ForEveryTrialInside(*method.input_type(), [&](const Trial& trial) {
      const absl::Status status = attacker.Call(method, *trial.message);
      const bool by_rule =
          absl::IsInvalidArgument(status) &&
          status.message().find(std::string(trial.field->name())) != absl::string_view::npos;
      EXPECT_EQ(by_rule && status.message().find(std::string(method.input_type()->name())) !=
                               absl::string_view::npos,
                trial.is_broken)
          << std::string(method.name()) << ", " << std::string(trial.field->full_name()) << ", "
          << trial.what << ": " << status;
      (trial.is_broken ? broken : kept) += 1;
    });
  }
  EXPECT_GT(broken, 40);
  EXPECT_GT(kept, 20);
  EXPECT_LT(LinesOfRefusals(), broken) << "said once for a field, not for a message";
  End("each rule of each request");
}

TEST_F(Attack, EachRuleOfEachMessageOfAWorkerIsBrokenAndItsStreamEndsOrItsAttemptFails) {
  int ended = 0;
  int refused = 0;
  int attempt = 0;
  ForEveryTrialInside(*v1::WorkerMessage::descriptor(), [&](const Trial& trial) {
    if (!trial.is_broken) return;
    v1::WorkerMessage message;
    message.CopyFrom(*trial.message);
    const v1::Hello hello =
        message.has_hello() ? message.hello() : MatchingHello("w" + std::to_string(++attempt), 1);
    FakeWorker worker(deployment_.address(), hello);
    if (!message.has_hello()) worker.Send(message);
    const auto answer = worker.Receive(v1::ServerMessage::kAck, kAnswered);
    if (answer.has_value()) {
      EXPECT_TRUE(answer->ack().refused()) << trial.what;
      ++refused;
    } else {
      const absl::Status status = worker.Finish();
      EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument)
          << std::string(trial.field->full_name()) << ", " << trial.what << ": " << status;
      ++ended;
    }
  });
  EXPECT_GT(ended, 20);
  EXPECT_GT(refused, 10);
  End("each rule of each message of a worker");
}

TEST_F(Attack, WhatHasEndedAServerOnce) {
  // A core time that is no number, of an attempt that the worker was leased.
  FakeWorker worker(deployment_.address(), MatchingHello("w", 1));
  for (const double core_time :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -1.0}) {
    const auto lease = worker.Receive(v1::ServerMessage::kLease, kAnswered);
    ASSERT_TRUE(lease.has_value());
    v1::WorkerMessage finished;
    finished.mutable_finished()->set_attempt(lease->lease().attempt());
    finished.mutable_finished()->set_outcome(v1::Finished::OUTCOME_DIVERGED);
    finished.mutable_finished()->set_core_seconds(core_time);
    worker.Send(finished);
    const auto ack = worker.Receive(v1::ServerMessage::kAck, kAnswered);
    ASSERT_TRUE(ack.has_value());
    EXPECT_TRUE(ack->ack().refused());
  }
  // Reasons of megabytes: within a message, and beyond one.
  for (const std::size_t bytes : {1'000'000, 3'000'000}) {
    FakeWorker talker(deployment_.address(), MatchingHello("talker", 1));
    v1::WorkerMessage finished;
    finished.mutable_finished()->set_attempt(1);
    finished.mutable_finished()->set_reason(std::string(bytes, 'x'));
    talker.Send(finished);
    const auto ack = talker.Receive(v1::ServerMessage::kAck, kAnswered);
    EXPECT_EQ(ack.has_value(), bytes < 2'000'000);
  }
  // A name that is taken, by who does not tell who it is; and more slots than there can be.
  v1::Hello thief = MatchingHello("w", 1);
  thief.clear_instance();
  EXPECT_EQ(FakeWorker(deployment_.address(), thief).Finish().code(),
            absl::StatusCode::kInvalidArgument);
  for (const int slots : {1'000'000, 4096}) {
    FakeWorker greedy(deployment_.address(), MatchingHello("greedy", slots));
    EXPECT_FALSE(greedy.Receive(v1::ServerMessage::kLease, kAnswered).has_value());
    EXPECT_FALSE(greedy.Finish().ok());
  }
  EXPECT_TRUE(worker.Receive(v1::ServerMessage::kLease, kAnswered).has_value())
      << "the one whose name it is goes on";
  EXPECT_TRUE(client_.Show("c1").ok());
  End("what has ended a server once");
  // And it starts again.
  deployment_.server().Kill();
  ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
  EXPECT_TRUE(deployment_.client().Show("c1").ok());
}

TEST_F(Attack, HeartbeatsWithUnknownAttemptsByWorkersThatDoNotRead) {
  v1::WorkerMessage heartbeat;
  for (int k = 0; k < 4096; ++k) {
    heartbeat.mutable_heartbeat()->add_attempts(1'000'000'000 + k);
  }
  std::vector<std::jthread> attackers;
  for (int k = 0; k < 8; ++k) {
    attackers.emplace_back([this, k, &heartbeat] {
      Attacker(deployment_.address())
          .FloodWithoutReading(MatchingHello("flood" + std::to_string(k), 1024), heartbeat, 5000,
                               seconds(4));
    });
  }
  attackers.clear();
  End("heartbeats with unknown attempts");
}

TEST_F(Attack, FilesThatAreSentByTheTenAndNeverEnd) {
  constexpr std::int64_t kBytes = std::int64_t{64} << 20;
  std::vector<std::jthread> attackers;
  std::atomic<std::int64_t> taken = 0;
  for (int k = 0; k < 10; ++k) {
    attackers.emplace_back(
        [&] { taken += Attacker(deployment_.address()).UploadWithoutEnd(kBytes, seconds(8)); });
  }
  attackers.clear();
  EXPECT_GT(taken, 10 * kBytes / 4) << "they were taken, not in memory";
  End("ten uploads");
}

TEST_F(Attack, FilesThatAreAskedForByTheHundredAndNeverRead) {
  const std::string content(std::size_t{24} << 20, 'x');
  ASSERT_TRUE(client_.PutBlob(content).ok());
  std::vector<std::jthread> attackers;
  for (int k = 0; k < 10; ++k) {
    attackers.emplace_back([&] {
      Attacker(deployment_.address())
          .DownloadWithoutReading(rpc::Sha256Hex(content), 10, seconds(3));
    });
  }
  attackers.clear();
  End("a hundred downloads");
}

TEST_F(Attack, ACovarianceOfFourThousandReadingsIsRefusedAndNobodyWaitsForIt) {
  constexpr int kReadings = 4000;
  std::string data = "# axial ratio\n";
  std::string covariance;
  for (int i = 0; i < kReadings; ++i) {
    data += std::to_string(0.001 * i) + " " + std::to_string(1 + 1e-4 * i) + "\n";
    std::string row(2 * kReadings, ' ');
    for (int j = 0; j < kReadings; ++j) row[static_cast<std::size_t>(2 * j)] = i == j ? '1' : '0';
    covariance += row + "\n";
  }
  campaign_.files["data.txt"] = data;
  campaign_.files["c.txt"] = covariance;
  const std::string noise = "noise: {relative: 0.1, floor: 0.1}";
  campaign_.yaml.replace(campaign_.yaml.find(noise), noise.size(), "noise: {covariance: c.txt}");
  for (int k = 0; k < 3; ++k) {
    const auto refused = client_.SubmitCampaign(campaign_.yaml, campaign_.files, "large");
    EXPECT_NE(refused.status().message().find("--max-covariance"), absl::string_view::npos)
        << refused.status();
  }
  End("a covariance of 4000 readings");
}

TEST_F(Attack, CampaignsOfAMillionSamplesAndTextsThatAreAllBrackets) {
  const std::string samples = "samples: 8";
  std::string yaml = campaign_.yaml;
  yaml.replace(yaml.find(samples), samples.size(), "samples: 1000000");
  EXPECT_NE(client_.SubmitCampaign(yaml, campaign_.files, "many")
                .status()
                .message()
                .find("--max-samples"),
            absl::string_view::npos);
  for (const char* opened : {"[", "{a: ", "- "}) {
    std::string text;
    while (text.size() + 4 < (std::size_t{1} << 20)) text += opened;
    v1::SubmitRequest request;
    request.set_request_id("brackets");
    request.set_campaign_file(text);
    request.set_file_name("campaign.yaml");
    const auto reply = client_.Submit(request);
    ASSERT_TRUE(reply.ok()) << reply.status();
    EXPECT_EQ(reply->problems_size(), 1);
  }
  End("campaigns that cannot be");
}

class FewFiles : public Attack {
 protected:
  FewFiles() : Attack({.name = "few-files", .lease_ms = 20000, .open_files = 300}) {}
};

TEST_F(FewFiles, ConnectionsByTheHundredAreTurnedAwayAndOthersComeAfterThem) {
  {
    const SilentConnections silent(deployment_.address(), 400);
    ASSERT_TRUE(Eventually(kAnswered, [&] {
      return deployment_.Logs().find("connection_turned_away") != std::string::npos;
    }));
    EXPECT_TRUE(client_.List().ok()) << "who was there before stays";
  }
  Client later = deployment_.client();
  EXPECT_TRUE(Eventually(kAnswered, [&] { return later.List().ok(); }));
  FakeWorker worker(deployment_.address(), MatchingHello("w", 1));
  EXPECT_TRUE(worker.Receive(v1::ServerMessage::kLease, kAnswered).has_value());
  End("connections by the hundred");
}

}  // namespace
}  // namespace calib::testing
