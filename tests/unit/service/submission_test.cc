#include "server/service/submission.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <variant>

#include "server/campaign/file/campaign_file.h"
#include "server/campaign/model/sha256.h"
#include "server/store/store.h"
#include "tests/support/small_campaign.h"

namespace calib::service {
namespace {

// Number of the rules by which a submitted campaign is going to be read.
int RulesOf(store::Store& store, const testing::SmallCampaign& campaign, const std::string& extra) {
  v1::SubmitRequest request;
  request.set_campaign_file(campaign.yaml + extra);
  request.set_file_name("small.yaml");
  for (const auto& [path, content] : campaign.files) {
    const std::string digest = campaign::Sha256Hex(content);
    const auto put = [&digest, &content = content](store::Transaction& t) {
      t.PutBlob(digest, content);
    };
    EXPECT_TRUE(store.WriteNow(put).ok());
    (*request.mutable_files())[path] = digest;
  }
  auto reader = store.Read();
  const auto checked = CheckSubmission(request, Limits{}, *reader);
  EXPECT_TRUE(checked.ok()) << checked.status();
  const auto* accepted = std::get_if<store::NewCampaign>(&*checked);
  EXPECT_NE(accepted, nullptr) << std::get<v1::SubmitReply>(*checked).problems(0).message();
  return accepted != nullptr ? accepted->reading_rules : 0;
}

// What follows from a campaign is computed from the data that its results stand on.
TEST(Submission, ADerivedCampaignIsReadByTheRulesOfItsParent) {
  const std::string path = ::testing::TempDir() + "/submission_test.db";
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path + suffix);
  auto store = store::Store::Open(path);
  ASSERT_TRUE(store.ok()) << store.status();
  const auto campaign = testing::MakeSmallCampaign({.samples = 8, .max_iterations = 1});
  EXPECT_EQ(RulesOf(**store, campaign, ""), campaign::kReadingRules);
  ASSERT_TRUE((*store)
                  ->WriteNow([&campaign](store::Transaction& t) {
                    t.InsertCampaign({.id = 1, .name = "old", .yaml = campaign.yaml}, {});
                  })
                  .ok());
  EXPECT_EQ(RulesOf(**store, campaign, "lineage: {parent: c1, purpose: warm_fit}\n"), 1);
  EXPECT_EQ(RulesOf(**store, campaign, "lineage: {parent: c99, purpose: warm_fit}\n"),
            campaign::kReadingRules);
}

}  // namespace
}  // namespace calib::service
