// A server that says what it must not: worker and client hold what they receive to the rules, too.
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <mutex>

#include "calib/v1/campaign.grpc.pb.h"
#include "calib/v1/worker.grpc.pb.h"
#include "server/client/client.h"
#include "tests/support/process.h"

namespace calib::testing {
namespace {

constexpr std::chrono::seconds kHeard{20};

/// Says the same to every worker, takes what it hears of its attempts, then lets it drain.
class ForgedLink final : public v1::WorkerLink::Service {
 public:
  explicit ForgedLink(std::vector<v1::ServerMessage> said) : said_(std::move(said)) {}

  grpc::Status Connect(
      grpc::ServerContext* /*context*/,
      grpc::ServerReaderWriter<v1::ServerMessage, v1::WorkerMessage>* stream) override {
    v1::WorkerMessage message;
    stream->Read(&message);  // Hello
    for (const v1::ServerMessage& said : said_) stream->Write(said);
    while (stream->Read(&message)) {
      if (!message.has_finished()) continue;
      const std::lock_guard lock(mutex_);
      finished_[message.finished().attempt()] = message.finished();
      v1::ServerMessage ack;
      ack.mutable_ack()->set_attempt(message.finished().attempt());
      ack.mutable_ack()->set_finished(true);
      stream->Write(ack);
      if (finished_.size() == 2) {
        v1::ServerMessage drain;
        drain.mutable_drain();
        stream->Write(drain);
      }
    }
    return grpc::Status::OK;
  }

  std::map<std::int64_t, v1::Finished> finished() const {
    const std::lock_guard lock(mutex_);
    return finished_;
  }

 private:
  const std::vector<v1::ServerMessage> said_;
  mutable std::mutex mutex_;
  std::map<std::int64_t, v1::Finished> finished_;
};

class ForgedCampaigns final : public v1::Campaigns::Service {
 public:
  grpc::Status Show(grpc::ServerContext* /*context*/, const v1::CampaignRequest* request,
                    v1::CampaignStatus* reply) override {
    reply->set_campaign(request->campaign());
    reply->set_reason(std::string(request->campaign() == "c1" ? 3'000'000 : 3, 'x'));
    return grpc::Status::OK;
  }

  grpc::Status GetStates(grpc::ServerContext* /*context*/, const v1::StatesRequest* /*request*/,
                         grpc::ServerWriter<v1::SampleStates>* writer) override {
    v1::SampleStates states;
    states.add_states()->add_values(std::numeric_limits<double>::quiet_NaN());
    writer->Write(states);
    return grpc::Status::OK;
  }
};

std::string Serve(grpc::Service& service, std::unique_ptr<grpc::Server>& server) {
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&service);
  server = builder.BuildAndStart();
  return "127.0.0.1:" + std::to_string(port);
}

TEST(ForgedServer, ALeaseThatBreaksARuleHasFailedAndTheWorkerGoesOn) {
  v1::ServerMessage welcome;
  welcome.mutable_welcome()->set_heartbeat_ms(100);
  welcome.mutable_welcome()->set_lease_ms(10'000);
  v1::ServerMessage silent;
  silent.mutable_welcome();  // of a server that never wants to hear anything
  v1::ServerMessage without_spec;
  without_spec.mutable_lease()->set_attempt(5);
  v1::ServerMessage of_no_density;
  of_no_density.mutable_lease()->set_attempt(6);
  v1::AttemptSpec& spec = *of_no_density.mutable_lease()->mutable_spec();
  spec.set_contact("hertz_mindlin");
  spec.set_test("triaxial_drained");
  spec.set_experiment("tx");
  spec.set_density(std::numeric_limits<double>::quiet_NaN());
  ForgedLink link({welcome, silent, without_spec, of_no_density});
  std::unique_ptr<grpc::Server> server;
  const std::string address = Serve(link, server);
  const std::string log = FreshFolder("forged-server") + "/worker.log";
  Process worker({Program("calib-worker"), "--server", address, "--name", "w"}, log);
  EXPECT_EQ(worker.Wait(kHeard), 0) << "drained";
  const auto finished = link.finished();
  ASSERT_EQ(finished.size(), 2U);
  EXPECT_EQ(finished.at(5).outcome(), v1::Finished::OUTCOME_FAILED);
  EXPECT_EQ(finished.at(5).reason(), "the lease names no model");
  EXPECT_EQ(finished.at(6).outcome(), v1::Finished::OUTCOME_FAILED);
  EXPECT_EQ(finished.at(6).reason(),
            "ServerMessage.lease.spec.density is nan, it has to be finite and at least 0");
  server->Shutdown();
}

TEST(ForgedServer, AnAnswerThatBreaksARuleIsNoAnswer) {
  ForgedCampaigns campaigns;
  std::unique_ptr<grpc::Server> server;
  const auto client = client::Client::Connect(Serve(campaigns, server));
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_TRUE((*client)->Show("c2").ok());
  const absl::Status long_reason = (*client)->Show("c1").status();
  EXPECT_EQ(long_reason.code(), absl::StatusCode::kDataLoss);
  EXPECT_NE(long_reason.message().find("CampaignStatus.reason has 3000000 bytes, at most 8192"),
            absl::string_view::npos)
      << long_reason;
  EXPECT_EQ((*client)->GetStates("c1", std::nullopt).status().code(), absl::StatusCode::kDataLoss);
  server->Shutdown();
}

}  // namespace
}  // namespace calib::testing
