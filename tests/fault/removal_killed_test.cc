// kill -9 of a server while it removes what was deleted: nothing of that is seen again, nothing
// else is missing, and it goes on where it was.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <random>
#include <thread>

#include "server/store/store.h"
#include "tests/support/deployment.h"
#include "tests/support/small_campaign.h"

namespace calib::testing {
namespace {

constexpr std::chrono::seconds kLong{60};
constexpr int kSamples = 300;
constexpr int kSteps = 300;

/// A finished campaign with many states, as a server has left it.
void AddCampaign(store::Store& store, std::int64_t id, int samples) {
  const SmallCampaign campaign;
  for (int first = 0; first < samples; first += 50) {
    const absl::Status status = store.WriteNow([&](store::Transaction& t) {
      if (first == 0) {
        t.InsertCampaign({.id = id, .name = "sand", .yaml = campaign.yaml, .samples = samples}, {});
        t.InsertIteration(id, 0, "{}");
        t.SetProgress(id, {.state = store::CampaignState::kFinished});
      }
      for (int sample = first; sample < std::min(samples, first + 50); ++sample) {
        const store::EvaluationKey key{.campaign = id, .sample = sample, .experiment = 0};
        t.InsertSample(id, {.sample = sample, .parameters = {1e9, 0.5}});
        t.InsertEvaluation(
            {.key = key, .status = store::EvaluationStatus::kFinished, .digest = "d"});
        for (int step = 0; step < kSteps; ++step) {
          t.PutState({.key = key, .load_step = step, .observables = {1.0, 2.0}}, 0);
        }
      }
    });
    ASSERT_TRUE(status.ok()) << status;
  }
}

TEST(RemovalKilled, AtRandomMomentsOfADeletion) {
  Deployment deployment({.name = "killed-removal"});
  std::filesystem::create_directories(deployment.state());
  chmod(deployment.state().c_str(), S_IRWXU);
  const std::string file = deployment.state() + "/calib.db";
  {
    const auto store = store::Store::Open(file);
    ASSERT_TRUE(store.ok()) << store.status();
    AddCampaign(**store, 1, kSamples);
    AddCampaign(**store, 2, 5);
  }
  const auto before = std::filesystem::file_size(file);
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  v1::ControlRequest request;
  request.set_campaign("c1");
  request.set_request_id("r");
  ASSERT_TRUE(deployment.client().Delete(request).ok());
  std::mt19937 random(20260102);
  std::uniform_int_distribution<int> moment(0, 120);
  for (int life = 0; life < 6; ++life) {
    const auto list = deployment.client().List();
    ASSERT_TRUE(list.ok()) << list.status();
    ASSERT_EQ(list->campaigns_size(), 1) << "what was acknowledged stays";
    EXPECT_EQ(list->campaigns(0).campaign(), "c2");
    EXPECT_TRUE(absl::IsNotFound(deployment.client().States("c1").status()));
    EXPECT_TRUE(deployment.client().Delete(request).ok()) << "asked again it is the same answer";
    // A random moment, not a synchronisation: any will do.
    std::this_thread::sleep_for(std::chrono::milliseconds(moment(random)));
    deployment.server().Kill();
    ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  }
  ASSERT_TRUE(Eventually(kLong, [&] {
    const auto report = deployment.client().Examine();
    return report.ok() && report->leaving() == 0 && report->database_free_bytes() == 0;
  })) << deployment.Logs();
  EXPECT_EQ(deployment.client().Examine()->database(), "");
  ASSERT_TRUE(Eventually(kLong, [&] { return std::filesystem::file_size(file) < before / 4; }))
      << std::filesystem::file_size(file) << " of " << before;
  deployment.server().Kill();
  const auto store = store::Store::Open(file);
  ASSERT_TRUE(store.ok()) << store.status();
  auto reader = (*store)->Read();
  EXPECT_EQ(reader->States(2)->size(), 5U * kSteps);
  EXPECT_TRUE(reader->States(1)->empty());
  EXPECT_TRUE(reader->Evaluations(1)->empty());
}

}  // namespace
}  // namespace calib::testing
