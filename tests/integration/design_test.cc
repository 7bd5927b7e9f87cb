// A design that grows, with real processes: a client that adds batches and waits, a server,
// workers.
#include <gtest/gtest.h>

#include "proto/rpc/digest.h"
#include "server/campaign/file/derive.h"
#include "server/client/laboratory.h"
#include "server/client/load_view.h"
#include "server/methods/registry.h"
#include "tests/support/deployment.h"
#include "tests/support/small_campaign.h"

namespace calib::testing {
namespace {

constexpr std::chrono::seconds kPatienceOfDesign{60};

v1::AddRunsRequest BatchOf(int iteration, const std::string& stage,
                           const std::vector<std::vector<double>>& rows) {
  v1::AddRunsRequest batch;
  batch.set_campaign("c2");
  batch.set_iteration(iteration);
  batch.set_stage(stage);
  for (const std::vector<double>& values : rows) {
    v1::AddRunsRequest::Row& row = *batch.add_rows();
    row.mutable_parameters()->Add(values.begin(), values.end());
    row.set_stream(4 + batch.rows_size());
  }
  return batch;
}

// Parameters: young_modulus, friction_angle, linear_cohesion.energy_density, numerics.rate.
const std::vector<std::vector<double>> kScoutRows = {{1e8, 0.3, 0, 1}, {1e8, 0.3, 2e4, 1}};
const std::vector<std::vector<double>> kMainRows = {
    {2e8, 0.4, 1e4, 1}, {2e8, 0.4, 0, 2}, {3e8, 0.5, 3e4, 1}};

/// Runs and their states as a diagnosis would read them, effort left out.
std::string BitsOf(const report::CampaignView& view) {
  std::string bytes;
  for (v1::Sample sample : view.samples) {
    sample.clear_attempts();
    bytes += rpc::BytesOf(sample);
  }
  for (const auto& [key, history] : view.states) {
    bytes += key.first + std::to_string(key.second);
    for (const v1::State& state : history.states) bytes += rpc::BytesOf(state);
  }
  return bytes;
}

/// Of a design grown by two batches; killed: the server is, while the second one runs.
void Grow(int workers, bool killed, std::string& bits) {
  Deployment deployment({.name = "design-" + std::to_string(workers) + (killed ? "k" : "")});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  for (int i = 0; i < workers; ++i) deployment.StartWorker();
  Client client = deployment.client();
  const SmallCampaign base = MakeSmallCampaign({.samples = 4, .max_iterations = 1, .packings = 2});
  ASSERT_TRUE(client.SubmitCampaign(base.yaml, base.files, "base").ok());
  ASSERT_TRUE(client.Watch("c1", kPatienceOfDesign).ok());

  const client::ServerChoice choice{.address = deployment.address()};
  auto session = client::Session::Open(choice);
  ASSERT_TRUE(session.ok()) << session.status();
  client::Laboratory laboratory(**session, choice);
  const auto parent = client::LoadView((*session)->client(), "c1");
  ASSERT_TRUE(parent.ok()) << parent.status();
  const auto text = campaign::Derive(
      methods::All(), parent->source.campaign_file(),
      {.name = "race",
       .lineage = {.parent = "c1", .purpose = "design"},
       .parameters = {{"linear_cohesion.energy_density",
                       {.kind = "log_uniform", .min = 1e3, .max = 1e5}},
                      {"numerics.rate", {.kind = "log_uniform", .min = 0.5, .max = 2}}},
       .held_out = false,
       .first_proposal = std::nullopt,
       .race = std::vector<std::string>{"linear_cohesion"}});
  ASSERT_TRUE(text.ok()) << text.status();
  const auto empty = laboratory.Run(*parent, *text, "a design");
  ASSERT_TRUE(empty.ok()) << empty.status();
  EXPECT_EQ(empty->status.campaign(), "c2");
  EXPECT_TRUE(empty->samples.empty());
  const auto scout = laboratory.Grow(BatchOf(0, "scout", kScoutRows), "scout");
  ASSERT_TRUE(scout.ok()) << scout.status();
  EXPECT_EQ(scout->samples.size(), 2U);
  const v1::AddRunsRequest second = BatchOf(1, "main", kMainRows);
  if (killed) {
    ASSERT_TRUE(client.AddRuns(second).ok());
    deployment.server().Kill();
    ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  }
  const auto grown = laboratory.Grow(second, "main");
  ASSERT_TRUE(grown.ok()) << grown.status() << deployment.Logs();
  const auto again = laboratory.Grow(second, "main");
  ASSERT_TRUE(again.ok()) << again.status();
  ASSERT_EQ(again->samples.size(), 5U);
  for (const v1::Sample& sample : again->samples) EXPECT_EQ(sample.status(), "finished");
  EXPECT_EQ(again->samples[2].index(), 256);
  EXPECT_EQ(again->samples[2].purpose(), "main");
  EXPECT_EQ(again->samples[2].stream(), 5);
  // An effect and numerics that are in the run are in its readings.
  EXPECT_NE(rpc::BytesOf(again->states.at({"tx", 0}).states.back()),
            rpc::BytesOf(again->states.at({"tx", 1}).states.back()));
  EXPECT_TRUE(laboratory.Finished("c2").status().message().find("is no calibration but a trial") !=
              absl::string_view::npos);
  bits = BitsOf(*again);
}

TEST(Design, SameBitsForAnyNumberOfWorkersAndAServerThatIsKilled) {
  std::string one;
  ASSERT_NO_FATAL_FAILURE(Grow(1, false, one));
  std::string three;
  ASSERT_NO_FATAL_FAILURE(Grow(3, false, three));
  EXPECT_TRUE(one == three);
  std::string killed;
  ASSERT_NO_FATAL_FAILURE(Grow(2, true, killed));
  EXPECT_TRUE(one == killed);
}

}  // namespace
}  // namespace calib::testing
