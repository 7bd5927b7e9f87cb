// The campaigns of deploy/examples: what a user runs first is read without a warning.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "server/campaign/file/campaign_file.h"
#include "server/methods/registry.h"

namespace calib::campaign {
namespace {

namespace fs = std::filesystem;

std::string TextOf(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// A copy of the examples, in which scripts that make readings can leave them.
fs::path CopyOfExamples() {
  fs::path copy = fs::path(::testing::TempDir()) / "shipped_campaigns";
  fs::remove_all(copy);
  fs::copy(CALIB_EXAMPLES, copy, fs::copy_options::recursive);
  return copy;
}

std::vector<fs::path> CampaignsIn(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".yaml") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

bool NeedsMeasurements(const fs::path& campaign) {
  return TextOf(campaign).find("$CALIB_DATA") != std::string::npos ||
         fs::exists(campaign.parent_path() / "make_readings");
}

void ExpectNoWarning(const fs::path& campaign) {
  const auto outcome = ReadCampaign(methods::All(), TextOf(campaign), campaign.filename(),
                                    DiskReader(campaign.string()));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << campaign << ToString(problem);
  for (const Warning& warning : outcome.warnings) ADD_FAILURE() << campaign << Sentence(warning);
}

TEST(ShippedCampaigns, RaiseNoWarning) {
  int read = 0;
  for (const fs::path& campaign : CampaignsIn(CALIB_EXAMPLES)) {
    if (NeedsMeasurements(campaign)) continue;
    ExpectNoWarning(campaign);
    ++read;
  }
  EXPECT_GE(read, 2);  // those whose measurements are synthetic
}

TEST(ShippedCampaigns, RaiseNoWarningOnTheMeasurements) {
  const char* data = std::getenv("CALIB_DATA");
  if (data == nullptr || !fs::is_directory(data)) {
    GTEST_SKIP() << "left out: $CALIB_DATA is no folder here";
  }
  const fs::path examples = CopyOfExamples();
  int read = 0;
  for (const fs::path& campaign : CampaignsIn(examples)) {
    if (!NeedsMeasurements(campaign)) continue;
    const fs::path script = campaign.parent_path() / "make_readings";
    if (fs::exists(script)) {
      ASSERT_EQ(std::system(script.c_str()), 0) << script;  // NOLINT(cert-env33-c)
    }
    ExpectNoWarning(campaign);
    ++read;
  }
  EXPECT_GE(read, 9);
}

}  // namespace
}  // namespace calib::campaign
