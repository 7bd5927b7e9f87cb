// A disk that is full in the middle of a campaign, and then has room: a small file system of its
// own is mounted for each test, in a mount namespace that only this process and its children see.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "server/client/laboratory.h"
#include "server/service/state_folder.h"
#include "server/store/connection.h"
#include "server/store/migrations.h"
#include "server/store/store.h"
#include "tests/fault/undisturbed.h"
#include "tests/support/small_disk.h"

namespace calib::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kFull = "the disk of the state folder takes nothing since ";
constexpr const char* kGoesOn = "the server goes on by itself when it does";

void WriteTo(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

std::string TextOf(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

int Count(const std::string& text, const std::string& what) {
  int count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) {
    ++count;
  }
  return count;
}

class FullDiskInUse : public ::testing::Test {
 protected:
  void SetUp() override {
    static const bool own_mounts = HaveOwnMounts();  // before there is another thread
    disk_ = own_mounts ? std::make_unique<SmallDisk>(deployment_.state(), 16) : nullptr;
    if (disk_ == nullptr || !disk_->mounted()) {
      GTEST_SKIP() << "left out: this account may mount nothing, as root or by `unshare -rm`";
    }
  }

  /// A server and a worker, and the campaign on its way with some states stored.
  void Begin() {
    ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
    deployment_.StartWorker(2);
    Client client = deployment_.client();
    const SmallCampaign campaign = FaultCampaign();
    const auto id = client.SubmitCampaign(campaign.yaml, campaign.files, "r");
    ASSERT_TRUE(id.ok()) << id.status();
    ASSERT_TRUE(Eventually(kLong, [&] { return StatesNow(client).size() > 20; }));
  }

  std::string Waits() const {
    Client client = deployment_.client();
    const auto status = client.Show("c1");
    return status.ok() ? status->server_waits() : "";
  }

  /// The disk is full, and the server has met that.
  void Fill() {
    disk_->Fill();
    ASSERT_TRUE(Eventually(kLong, [&] { return !Waits().empty(); })) << deployment_.Logs();
  }

  struct Answer {
    int code = -1;
    std::string out{};
  };
  Answer Calibctl(const std::string& arguments) const {
    const std::string out = deployment_.folder() + "/answer";
    const int status = std::system((Program("calibctl") + " " + arguments + " --server " +
                                    deployment_.address() + " >" + out + " 2>&1")
                                       .c_str());
    return {.code = WEXITSTATUS(status), .out = TextOf(out)};
  }

  std::string ServerLog() const { return TextOf(deployment_.folder() + "/server.log"); }

  Deployment deployment_{{.name = "full-disk", .lease_ms = 800, .heartbeat_ms = 20}};
  std::unique_ptr<SmallDisk> disk_;
};

TEST_F(FullDiskInUse, IsSaidAndWaitedForAndChangesNoBit) {
  Begin();
  Fill();
  Client client = deployment_.client();
  const std::set<std::string> acknowledged = StatesNow(client);

  EXPECT_THAT(Waits(), HasSubstr(kFull));
  EXPECT_THAT(Waits(), HasSubstr(kGoesOn));
  const Answer show = Calibctl("show c1");
  EXPECT_EQ(show.code, 0) << show.out;
  EXPECT_THAT(show.out, HasSubstr("! the disk of the state folder takes nothing"));
  const auto json = nlohmann::json::parse(Calibctl("show c1 --json").out, nullptr, false);
  EXPECT_THAT(json.value("server_waits", ""), HasSubstr(kFull));
  EXPECT_THAT(Calibctl("list").out, HasSubstr("! the disk of the state folder takes nothing"));
  const Answer doctor = Calibctl("doctor");
  EXPECT_EQ(doctor.code, 1) << doctor.out;
  EXPECT_THAT(doctor.out, HasSubstr("It waits: the disk of the state folder takes nothing"));
  EXPECT_THAT(doctor.out, HasSubstr("need not be started again"));

  // Changes are refused at once; what was asked can be asked again.
  v1::ControlRequest pause;
  pause.set_campaign("c1");
  pause.set_request_id("p");
  const auto paused = client.Pause(pause);
  EXPECT_EQ(paused.status().code(), absl::StatusCode::kResourceExhausted) << paused.status();
  EXPECT_THAT(std::string(paused.status().message()), HasSubstr(kGoesOn));
  const SmallCampaign other = MakeSmallCampaign({.samples = 4, .max_iterations = 1});
  EXPECT_EQ(client.SubmitCampaign(other.yaml, other.files, "s").status().code(),
            absl::StatusCode::kResourceExhausted);

  // Long enough for the worker's stream to be read no more and for its leases to run out some
  // times; a duration, not a synchronisation.
  std::this_thread::sleep_for(std::chrono::seconds(4));
  EXPECT_TRUE(deployment_.server().Running());
  ExpectContains(StatesNow(client), acknowledged);

  disk_->MakeRoom();
  ASSERT_TRUE(WaitFinished(deployment_)) << deployment_.Logs();
  EXPECT_EQ(Waits(), "");
  ExpectUndisturbed(deployment_);
  ExpectContains(StatesNow(client), acknowledged);
  const auto log = client.Log("c1");
  ASSERT_TRUE(log.ok()) << log.status();
  for (const v1::LogEntry& entry : *log) {
    EXPECT_THAT(entry.what(), ::testing::Not(HasSubstr(" lost"))) << "the worker was there";
  }
  EXPECT_EQ(Count(ServerLog(), " store_waits reason="), 1) << ServerLog();
  EXPECT_EQ(Count(ServerLog(), " store_goes_on waited_s="), 1) << ServerLog();
  EXPECT_EQ(Count(ServerLog(), "worker_disconnected"), 0) << ServerLog();
}

TEST_F(FullDiskInUse, ACampaignOfADiagnosisWaitsToBeSubmitted) {
  Begin();
  Fill();
  const client::ServerChoice choice{.address = deployment_.address()};
  auto session = client::Session::Open(choice);
  ASSERT_TRUE(session.ok()) << session.status();
  client::Client& asks = (*session)->client();
  report::CampaignView parent;
  parent.status = *asks.Show("c1");
  parent.source = *asks.GetSource("c1");
  client::Laboratory laboratory(**session, choice);
  auto submitted = std::async(std::launch::async, [&] {
    return laboratory.Submit(parent, parent.source.campaign_file() + "# another one\n", "a trial");
  });
  // Some tries long; a duration, not a synchronisation.
  EXPECT_EQ(submitted.wait_for(std::chrono::seconds(3)), std::future_status::timeout);
  disk_->MakeRoom();
  const auto campaign = submitted.get();
  ASSERT_TRUE(campaign.ok()) << campaign.status();
  EXPECT_EQ(*campaign, "c2");
}

TEST_F(FullDiskInUse, AServerKilledWhileItWaitsLosesNothingAcknowledged) {
  Begin();
  Fill();
  Client client = deployment_.client();
  const std::set<std::string> acknowledged = StatesNow(client);
  deployment_.server().Kill();
  disk_->MakeRoom();
  ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
  ASSERT_TRUE(WaitFinished(deployment_)) << deployment_.Logs();
  ExpectUndisturbed(deployment_);
  Client again = deployment_.client();
  ExpectContains(StatesNow(again), acknowledged);
}

TEST_F(FullDiskInUse, AServerThatWaitsEndsWhenItIsAskedTo) {
  Begin();
  Fill();
  deployment_.server().Signal(SIGTERM);
  EXPECT_EQ(deployment_.server().Wait(std::chrono::seconds(15)), 0) << deployment_.Logs();
  disk_->MakeRoom();
  ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
  ASSERT_TRUE(WaitFinished(deployment_)) << deployment_.Logs();
  ExpectUndisturbed(deployment_);
}

TEST_F(FullDiskInUse, AFileThatDoesNotFitIsRefusedAndNobodyWaitsForIt) {
  ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
  Client client = deployment_.client();
  // The first does not fit beside the state, the second not into it.
  for (const std::size_t mebibytes : {20, 9}) {
    const absl::Status put = client.PutBlob(std::string(mebibytes << 20U, 'g'));
    EXPECT_EQ(put.code(), absl::StatusCode::kResourceExhausted) << put;
    EXPECT_THAT(std::string(put.message()), HasSubstr("send it again"));
  }
  deployment_.StartWorker(2);
  const SmallCampaign campaign = FaultCampaign();
  // What was refused takes no room any more once its call has ended on the server as well.
  ASSERT_TRUE(Eventually(kLong, [&] {
    return client.SubmitCampaign(campaign.yaml, campaign.files, "r").ok();
  })) << deployment_.Logs();
  ASSERT_TRUE(WaitFinished(deployment_)) << deployment_.Logs();
  EXPECT_EQ(Count(ServerLog(), "store_waits"), 0) << ServerLog();
  ExpectUndisturbed(deployment_);
}

TEST_F(FullDiskInUse, CalibctlRunWaitsAndSaysSo) {
  const SmallCampaign campaign = FaultCampaign();
  const std::string folder = deployment_.folder();
  WriteTo(folder + "/campaign.yaml", campaign.yaml);
  for (const auto& [path, content] : campaign.files) WriteTo(folder + "/" + path, content);
  const std::string log = folder + "/run.log";
  Process run({Program("calibctl"), "run", folder + "/campaign.yaml", "--state",
               deployment_.state(), "--workers", "2", "--json"},
              log);
  ASSERT_TRUE(Eventually(kLong, [&] {
    const auto address = service::ServingAddress(deployment_.state());
    if (!address.ok()) return false;
    Client client(*address);
    return StatesNow(client).size() > 20;
  })) << TextOf(log);
  disk_->Fill();
  ASSERT_TRUE(Eventually(kLong, [&] { return Count(TextOf(log), kFull) == 1; })) << TextOf(log);
  EXPECT_TRUE(run.Running());
  disk_->MakeRoom();
  EXPECT_EQ(run.Wait(kLong), 0) << TextOf(log);
  EXPECT_EQ(Count(TextOf(log), "the disk takes what is written again, and the server goes on"), 1)
      << TextOf(log);
  EXPECT_EQ(Count(TextOf(deployment_.state() + "/server.log"), "store_goes_on"), 1);
  ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
  ExpectUndisturbed(deployment_);
}

TEST_F(FullDiskInUse, AMigrationWithoutRoomForItsCopyIsRefusedAndNothingIsChanged) {
  const std::string path = deployment_.state() + "/calib.db";
  const int earlier = static_cast<int>(store::Migrations().size()) - 1;
  const auto schema = [&path] {
    return store::Connection(path, true).database().execAndGet("PRAGMA user_version").getInt();
  };
  {
    store::Connection before(path, true);
    for (const auto& step : store::Migrations().first(static_cast<std::size_t>(earlier))) {
      before.database().exec(step.sql);
    }
    before.database().exec("PRAGMA user_version=" + std::to_string(earlier));
    before.database().exec("INSERT INTO blob VALUES('d', zeroblob(4000000))");
  }
  WriteTo(deployment_.state() + "/reserve", std::string(1'000'000, '\0'));
  disk_->Fill();
  const absl::Status full = store::Store::Open(path).status();
  EXPECT_EQ(full.code(), absl::StatusCode::kResourceExhausted) << full;
  EXPECT_THAT(std::string(full.message()), HasSubstr("its disk needs room"));
  std::filesystem::remove(deployment_.state() + "/reserve");  // enough to open it
  const absl::Status no_copy = store::Store::Open(path).status();
  EXPECT_EQ(no_copy.code(), absl::StatusCode::kResourceExhausted) << no_copy;
  EXPECT_THAT(std::string(no_copy.message()), HasSubstr("but no copy of it (about 4 MiB)"));
  EXPECT_THAT(std::string(no_copy.message()), HasSubstr("nothing has been changed"));
  disk_->MakeRoom();
  EXPECT_EQ(schema(), earlier);
  const std::string copy = path + ".before-" + std::to_string(earlier + 1);
  EXPECT_FALSE(std::filesystem::exists(copy));
  EXPECT_FALSE(std::filesystem::exists(copy + ".new"));
  EXPECT_TRUE(store::Store::Open(path).ok());
  EXPECT_EQ(schema(), earlier + 1);
  EXPECT_GT(std::filesystem::file_size(copy), 4'000'000U);
}

}  // namespace
}  // namespace calib::testing
