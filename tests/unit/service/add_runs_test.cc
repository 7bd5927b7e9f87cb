// Runs that are added to a design as a client asks for them: what is refused, to whom, and what is
// told of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>

#include "server/access/authority.h"
#include "server/service/server.h"
#include "tests/support/client.h"
#include "tests/support/process.h"
#include "tests/support/small_campaign.h"

namespace calib::service {
namespace {

using Code = absl::StatusCode;
using ::testing::HasSubstr;

constexpr std::chrono::seconds kPatience{20};

class AddRuns : public ::testing::Test {
 protected:
  void SetUp() override { folder_ = testing::FreshFolder("add_runs"); }

  void Serve(const std::string& tls = "") {
    auto server =
        Server::Start({.state_dir = folder_ + "/state", .tls = tls, .log_file = folder_ + "/log"});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }

  /// The design, c1 where it is the first campaign, once it is finished without a run.
  std::string SubmitDesign(testing::Client& client) const {
    const auto design =
        testing::MakeSmallDesign({.load_steps = 2, .packings = 2},
                                 "  load_cell_error.gain: {prior: uniform, min: 0.01, max: 0.3}\n",
                                 "  race: [load_cell_error]\n");
    const auto id = client.SubmitCampaign(design.yaml, design.files, "design");
    EXPECT_TRUE(id.ok()) << id.status();
    EXPECT_TRUE(testing::Eventually(kPatience, [&] {
      const auto status = client.Show(*id);
      return status.ok() && status->state() == "finished";
    }));
    return id.value_or("");
  }

  static v1::AddRunsRequest Batch() {
    v1::AddRunsRequest request;
    request.set_campaign("c1");
    request.set_stage("scout");
    for (const double gain : {0.0, 0.1}) {
      v1::AddRunsRequest::Row& row = *request.add_rows();
      for (const double value : {1e8, 0.3, gain}) row.add_parameters(value);
      row.set_stream(9);
    }
    return request;
  }

  std::string folder_;
  std::unique_ptr<Server> server_;
};

TEST_F(AddRuns, AreToldWithTheirStageAndStream) {
  ASSERT_NO_FATAL_FAILURE(Serve());
  testing::Client client(server_->address());
  ASSERT_EQ(SubmitDesign(client), "c1");
  const auto before = client.Show("c1");
  EXPECT_EQ(before->samples(), 0);
  EXPECT_EQ(before->method(), "design");
  EXPECT_THAT(std::string(client.Posterior("c1").status().message()),
              HasSubstr("runs the rows of its design and infers nothing"));
  const auto status = client.AddRuns(Batch());
  ASSERT_TRUE(status.ok()) << status.status();
  EXPECT_EQ(status->state(), "running");
  EXPECT_EQ(status->samples(), 2);
  EXPECT_EQ(status->samples_done(), 0);
  EXPECT_EQ(status->iteration(), 0);
  EXPECT_EQ(status->max_iterations(), 1);
  const auto again = client.AddRuns(Batch());
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->samples(), 2) << "added again it changes nothing";
  const auto samples = client.Samples("c1");
  ASSERT_EQ(samples->size(), 2U);
  for (const v1::Sample& sample : *samples) {
    EXPECT_EQ(sample.purpose(), "scout");
    EXPECT_EQ(sample.stream(), 9);
    EXPECT_EQ(sample.status(), "waiting");
  }
  const auto log = client.Log("c1");
  ASSERT_TRUE(log.ok()) << log.status();
  EXPECT_EQ(log->back().what(), "grow: batch 0 (scout), 2 runs");
}

TEST_F(AddRuns, AreRefusedWithTheReason) {
  ASSERT_NO_FATAL_FAILURE(Serve());
  testing::Client client(server_->address());
  ASSERT_EQ(SubmitDesign(client), "c1");
  const auto refusal = [&](Code code, const std::function<void(v1::AddRunsRequest&)>& change) {
    v1::AddRunsRequest request = Batch();
    change(request);
    const auto status = client.AddRuns(request);
    EXPECT_EQ(status.status().code(), code) << status.status();
    return std::string(status.status().message());
  };
  using R = v1::AddRunsRequest;
  EXPECT_THAT(refusal(Code::kNotFound, [](R& r) { r.set_campaign("c7"); }), HasSubstr("c7"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.clear_campaign(); }),
              HasSubstr("campaign"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.set_iteration(-1); }),
              HasSubstr("iteration"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.set_iteration(1000); }),
              HasSubstr("iteration"));
  EXPECT_THAT(refusal(Code::kFailedPrecondition, [](R& r) { r.set_iteration(1); }),
              HasSubstr("the next is 0"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.set_stage("draw"); }),
              HasSubstr("draw is no stage of a design: scout, main, sequential, verification, "
                        "numerics"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.clear_stage(); }), HasSubstr("stage"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.add_experiments(""); }),
              HasSubstr("experiments"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.add_experiments("tz"); }),
              HasSubstr("which has tx"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.clear_rows(); }),
              HasSubstr("a batch without a row"));
  EXPECT_THAT(refusal(Code::kInvalidArgument,
                      [](R& r) {
                        while (r.rows_size() < 257) *r.add_rows() = r.rows(0);
                      }),
              HasSubstr("rows"));
  EXPECT_THAT(refusal(Code::kInvalidArgument,
                      [](R& r) {
                        r.mutable_rows(1)->set_parameters(0,
                                                          std::numeric_limits<double>::quiet_NaN());
                      }),
              HasSubstr("rows[1].parameters"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.mutable_rows(0)->set_stream(-1); }),
              HasSubstr("stream"));
  EXPECT_THAT(
      refusal(Code::kInvalidArgument, [](R& r) { r.mutable_rows(1)->set_parameters(2, 0.5); }),
      HasSubstr("row 1: load_cell_error.gain = 0.5 lies outside its prior"));
  EXPECT_THAT(refusal(Code::kInvalidArgument, [](R& r) { r.mutable_rows(1)->add_parameters(1); }),
              HasSubstr("row 1: a row has 4 values"));
  EXPECT_EQ(client.Samples("c1")->size(), 0U) << "nothing was added";
  ASSERT_TRUE(client.AddRuns(Batch()).ok());
  EXPECT_THAT(refusal(Code::kAlreadyExists, [](R& r) { r.mutable_rows(0)->set_stream(8); }),
              HasSubstr("batch 0 of campaign c1 is there with other runs"));
  EXPECT_THAT(refusal(Code::kFailedPrecondition, [](R& r) { r.set_iteration(1); }),
              HasSubstr("that is running"));
}

TEST_F(AddRuns, AreTheOwnersAndTheOperatorsAffair) {
  const std::string ca = folder_ + "/ca";
  ASSERT_TRUE(access::InitAuthority(ca).ok());
  const auto issue = [&](const std::string& name, access::Role role) {
    const auto issued = access::Issue(ca, {.name = name, .role = role}, folder_ + "/" + name);
    ASSERT_TRUE(issued.ok()) << issued.status();
  };
  issue("head", access::Role::kServer);
  issue("ann", access::Role::kSubmitter);
  issue("bob", access::Role::kSubmitter);
  issue("vic", access::Role::kViewer);
  issue("olga", access::Role::kOperator);
  ASSERT_NO_FATAL_FAILURE(Serve(folder_ + "/head"));
  const auto client = [this](const std::string& name) {
    return testing::Client(server_->address(), {.tls = folder_ + "/" + name});
  };
  testing::Client ann = client("ann");
  ASSERT_EQ(SubmitDesign(ann), "c1");
  const auto bobs = client("bob").AddRuns(Batch());
  EXPECT_EQ(bobs.status().code(), Code::kPermissionDenied);
  EXPECT_THAT(std::string(bobs.status().message()), HasSubstr("c1 belongs to ann"));
  const auto vics = client("vic").AddRuns(Batch());
  EXPECT_EQ(vics.status().code(), Code::kPermissionDenied);
  EXPECT_THAT(std::string(vics.status().message()), HasSubstr("needs the role submitter"));
  EXPECT_EQ(ann.Samples("c1")->size(), 0U);
  EXPECT_TRUE(ann.AddRuns(Batch()).ok());
  EXPECT_TRUE(client("olga").AddRuns(Batch()).ok());
  server_.reset();  // the log is on the disk
  std::ifstream file(folder_ + "/log");
  const std::string log{std::istreambuf_iterator<char>(file), {}};
  EXPECT_THAT(log, HasSubstr("change what=add_runs of=c1 by=ann role=submitter"));
  EXPECT_THAT(log, ::testing::Not(HasSubstr("what=add_runs of=c1 by=olga"))) << "it was there";
}

}  // namespace
}  // namespace calib::service
