#include "tests/simulation/simulation.h"

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <string>
#include <variant>

#include "server/campaign/model/sha256.h"
#include "server/methods/registry.h"
#include "server/planning/definition.h"
#include "server/service/submission.h"
#include "server/store/store.h"
#include "tests/simulation/faults.h"

namespace calib::simulation {
namespace {

TEST(Simulation, ASeedGivesTheSameEventsAgain) {
  const SimulationResult once = Simulate({.seed = 3});
  const SimulationResult again = Simulate({.seed = 3});
  EXPECT_GT(once.events, 100);
  EXPECT_EQ(once.digest, again.digest);
  EXPECT_NE(once.digest, Simulate({.seed = 4}).digest);
}

TEST(Simulation, FindsWhatIsPlantedInDiskAndQueues) {
  for (const Fault& fault : Faults()) {
    if (fault.in_scheduler) continue;
    EXPECT_NE(Simulate({.seed = fault.seed, .fault = fault.name}).violation, "") << fault.name;
    EXPECT_EQ(Simulate({.seed = fault.seed}).violation, "") << fault.name;
  }
}

// Found by them: a run that was stopped early left its worker without a word to who looks on; the
// hello of a stranger of a worker's name is no word of that worker.
TEST(Simulation, SeedsThatHaveFoundSomethingStayGreen) {
  for (const std::uint64_t seed : {1796053309447, 1796053310932, 1796053311530}) {
    EXPECT_EQ(Simulate({.seed = seed}).violation, "") << seed;
  }
}

// Each read of the disk in turn fails.
TEST(Simulation, AFileThatCannotBeReadNowIsNoFaultOfItsCampaign) {
  CrashFileSystem disk;
  disk.Format(1);
  auto store = *store::Store::Open("/nowhere/calib.db");
  const testing::SmallCampaign& small = Campaigns().front().files;
  std::map<std::string, std::string> files;
  v1::SubmitRequest request;
  request.set_campaign_file(small.yaml);
  request.set_file_name("small.yaml");
  for (const auto& [path, content] : small.files) {
    (*request.mutable_files())[path] = files[path] = campaign::Sha256Hex(content);
  }
  const store::NewCampaign submitted{
      .id = 1, .name = "small", .yaml = small.yaml, .file_name = "small.yaml", .samples = 6};
  ASSERT_TRUE(store
                  ->WriteNow([&](store::Transaction& t) {
                    for (const auto& [path, content] : small.files) {
                      t.PutBlob(files[path], content);
                    }
                    t.InsertCampaign(submitted, files);
                  })
                  .ok());
  const auto reads = [&](const std::function<absl::Status(store::Reader&)>& read) {
    for (int after = 0;; ++after) {
      disk.Expect(DiskTrouble::kReadFails, after, 1);
      auto reader = store->Read();
      const absl::Status status = reader.ok() ? read(*reader) : reader.status();
      disk.ExpectNothing();
      if (status.ok()) return after;
      EXPECT_TRUE(absl::IsPermissionDenied(status)) << after << ": " << status;
    }
  };
  EXPECT_GT(reads([&](store::Reader& reader) {
              return planning::LoadDefinition(methods::All(), reader, submitted).status();
            }),
            5);
  EXPECT_GT(reads([&](store::Reader& reader) -> absl::Status {
              const auto checked = service::CheckSubmission(request, service::Limits(), reader);
              if (!checked.ok()) return checked.status();
              EXPECT_TRUE(std::holds_alternative<store::NewCampaign>(*checked));
              return absl::OkStatus();
            }),
            5);
}

}  // namespace
}  // namespace calib::simulation
