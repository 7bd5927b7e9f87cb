// The examples of server/campaign/CAMPAIGN_FILE.md are what a user copies first: all of them have
// to be good campaigns.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

std::vector<std::string> YamlBlocks(const std::string& path) {
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::string fence = "```yaml\n";
  std::vector<std::string> blocks;
  for (std::size_t at = text.find(fence); at != std::string::npos; at = text.find(fence, at)) {
    at += fence.size();
    blocks.push_back(text.substr(at, text.find("```", at) - at));
  }
  return blocks;
}

TEST(CampaignReadme, EveryExampleIsAGoodCampaign) {
  auto files = testing::GoodFiles();
  files["parameters.csv"] = "sample,E_GPa,km\n0,100,8000\n";
  files["states.csv"] = "sample,step,p_MPa,porosity\n0,0,1,0.4\n0,1,2,0.39\n";
  files["beads.dat"] = "#\te_a\tp\tn\n0.001\t1\t0.4\n0.002\t2\t0.39\n";
  files["database.csv"] =
      "# == TESTS ==\ntest_id,kind\nT1,drained\n# == DATA ==\n"
      "test_id,eps_a[%],eps_v[%],s3[kPa],s1[kPa]\nT1,0,0,50,50\nT1,0.1,,50,66\nT2,0,0,100,100\n";
  const auto blocks = YamlBlocks(CALIB_CAMPAIGN_FILE_REFERENCE);
  EXPECT_EQ(blocks.size(), 8U);
  for (std::string block : blocks) {
    if (block.rfind("name:", 0) != 0) {  // a part, to be joined to the whole file
      std::string whole = blocks.front();
      const std::string noise = "noise: given\n";
      if (block.rfind("noise:", 0) == 0) whole.erase(whole.find(noise), noise.size());
      block = whole + block;
    }
    EXPECT_EQ(testing::ProblemsOf(block, files), "") << block;
  }
}

}  // namespace
}  // namespace calib::campaign
