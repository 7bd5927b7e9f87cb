// What an operator keeps a server well with: backups and their restoration, pruning, logs.
#include <gmock/gmock.h>

#include <algorithm>
#include <csignal>
#include <sstream>
#include <thread>

#include "tests/integration/ctl/access_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Upkeep : public Access {
 protected:
  void Calibrate() {
    ASSERT_EQ(Ask("submit campaign.yaml", "").code, 0) << Read("err");
    const Process worker(
        {Program("calib-worker"), "--server", address_, "--slots", "1", "--name", "w1"},
        At("worker.err"));
    ASSERT_EQ(Ask("watch c1", "").code, 0) << Read("err");
  }
  /// calibd --restore until it has ended; the exit code.
  int Restore(const std::string& backup, const std::string& state) const {
    std::filesystem::remove(At("restore.err"));
    Process restore({Program("calibd"), "--restore", At(backup), "--state", At(state)},
                    At("restore.err"));
    return restore.Wait(kPatience);
  }
  /// Refused with one sentence.
  std::string Unrestored(const std::string& backup, const std::string& state) const {
    EXPECT_EQ(Restore(backup, state), 1);
    const std::string said = Read("restore.err");
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
    return said;
  }
};

TEST_F(Upkeep, ABackupOfARunningServerComesBackWithEveryBit) {
  auto server = Serve("state", {});
  Calibrate();
  const Answer taken = Ask("backup -o b.calib --json", "");
  ASSERT_EQ(taken.code, 0) << taken.err;
  EXPECT_EQ(taken.json()["backup"], "b.calib");
  EXPECT_EQ(taken.json()["sha256"].get<std::string>().size(), 64U);
  EXPECT_GT(std::filesystem::file_size(At("b.calib")), taken.json()["bytes"]);
  EXPECT_EQ(std::filesystem::status(At("b.calib")).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  const std::vector<std::string> questions = {"list --json", "posterior c1 --json",
                                              "samples c1 --json", "states c1 2 --json"};
  std::vector<std::string> answers;
  for (const std::string& question : questions) answers.push_back(Ask(question, "").out);
  ASSERT_EQ(Ask("delete c1", "").code, 0);
  server->Kill();

  ASSERT_EQ(Restore("b.calib", "new"), 0) << Read("restore.err");
  EXPECT_THAT(Read("restore.err"), HasSubstr("1 campaign\n"));
  server = Serve("new", {});
  for (std::size_t k = 0; k < questions.size(); ++k) {
    EXPECT_EQ(Ask(questions[k], "").out, answers[k]) << questions[k];
  }
  ASSERT_EQ(Ask("backup -o b.calib", "").code, 0) << "in the place of the earlier one";
  EXPECT_THAT(Ask("doctor", "").out, HasSubstr("The last was taken"));
}

TEST_F(Upkeep, WhatIsNoWholeBackupOrNoEmptyFolderIsRefusedAndNothingChanges) {
  auto server = Serve("state", {});
  Calibrate();
  ASSERT_EQ(Ask("backup -o whole", "").code, 0) << Read("err");
  const std::string whole = Read("whole");
  std::string flipped = whole;
  flipped[whole.size() / 2] ^= 1;
  Write("flipped", flipped);
  Write("cut", whole.substr(0, whole.size() - 4096));
  Write("longer", whole + "\n");
  Write("empty", "");
  EXPECT_THAT(Unrestored("flipped", "new"), HasSubstr("is damaged"));
  EXPECT_THAT(Unrestored("cut", "new"), HasSubstr("its end is missing"));
  EXPECT_THAT(Unrestored("longer", "new"), HasSubstr("no backup"));
  EXPECT_THAT(Unrestored("empty", "new"), HasSubstr("no backup"));
  EXPECT_THAT(Unrestored("data.csv", "new"), HasSubstr("no backup"));
  EXPECT_THAT(Unrestored("absent", "new"), HasSubstr("No such file"));
  EXPECT_FALSE(std::filesystem::exists(work_ / "new"));
  EXPECT_THAT(Unrestored("whole", "state"), HasSubstr("is not empty"));
  EXPECT_EQ(Ask("list --json", "").json().size(), 1U);
  std::filesystem::create_directory(work_ / "used");
  Write("used/notes", "mine");
  EXPECT_THAT(Unrestored("whole", "used"), HasSubstr("is not empty (notes)"));
  EXPECT_EQ(Read("used/notes"), "mine");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(work_ / "used"), {}), 1);
  // What a restore that was killed has left stands in nobody's way.
  std::filesystem::create_directory(work_ / "half");
  std::filesystem::permissions(work_ / "half", std::filesystem::perms::owner_all);
  Write("half/calib.db.restoring", whole.substr(0, 5000));
  Write("half/lock", "");
  EXPECT_EQ(Restore("whole", "half"), 0) << Read("restore.err");
  EXPECT_FALSE(std::filesystem::exists(work_ / "half/calib.db.restoring"));
}

TEST_F(Upkeep, ABackupGoesNowhereButToANewPlaceOrAnEarlierOne) {
  const auto server = Serve("state", {});
  const Answer over = Ask("backup -o state/calib.db", "");
  EXPECT_EQ(over.code, 2);
  EXPECT_THAT(over.err, HasSubstr("exists and is no backup"));
  EXPECT_EQ(Ask("backup -o .", "").code, 2);
  EXPECT_THAT(Refused("backup -o nowhere/b", ""), HasSubstr("nowhere/b cannot be written"));
  ASSERT_EQ(Ask("backup -o b", "").code, 0) << Read("err");
  const std::string before = Read("b");
  EXPECT_EQ(Call("backup -o b --server 127.0.0.1:" + std::to_string(FreePort())).code, 3);
  EXPECT_EQ(Read("b"), before);
  EXPECT_EQ(Call("backup").code, 2) << "to where it does not say";
}

TEST_F(Upkeep, OperatorsAloneTakeBackupsAndPrune) {
  IssueAll();
  const auto server = Serve("state", {"--tls", At("head")});
  for (const char* role : {"viewer", "submitter", "worker"}) {
    for (const char* verb : {"backup -o b", "prune"}) {
      EXPECT_THAT(Refused(verb, std::string("--tls ") + role), HasSubstr("operator")) << role;
    }
  }
  EXPECT_FALSE(std::filesystem::exists(work_ / "b"));
  EXPECT_EQ(Ask("backup -o b", "--tls operator").code, 0) << Read("err");
}

TEST_F(Upkeep, KilledWhileABackupIsTakenNothingIsLeft) {
  for (const int wait_ms : {0, 20, 60, 120, 250}) {
    auto server = Serve("state", {});
    if (wait_ms == 0) {
      Calibrate();
    }
    std::jthread backup([this] { Ask("backup -o b", ""); });
    std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
    server->Kill();
    backup.join();
    if (std::filesystem::exists(work_ / "b")) {
      std::filesystem::remove_all(work_ / "new");
      EXPECT_EQ(Restore("b", "new"), 0) << Read("restore.err");
      std::filesystem::remove(work_ / "b");
    }
  }
  const auto server = Serve("state", {});
  EXPECT_EQ(Ask("list --json", "").json().size(), 1U);
  for (const auto& entry : std::filesystem::directory_iterator(work_ / "state")) {
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr("backup")));
  }
  for (const auto& entry : std::filesystem::directory_iterator(work_)) {
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr(".part")));
  }
}

TEST_F(Upkeep, APrunedCampaignSaysSoWhereItsStatesAreNeeded) {
  const auto server = Serve("state", {});
  Calibrate();
  const std::string posterior = Ask("posterior c1 --json", "").out;
  EXPECT_EQ(Ask("prune --json", "").json(), Json({{"contents", 0}, {"campaigns", 0}}));
  EXPECT_EQ(Ask("compare c1", "").code, 0) << Read("err");
  const Answer pruned = Ask("prune --keep-states 1", "");
  EXPECT_EQ(pruned.code, 0) << pruned.err;
  EXPECT_THAT(pruned.out, HasSubstr("states of 1 campaign leave"));
  EXPECT_THAT(Refused("compare c1", ""), HasSubstr("c1 was pruned: the states of 1 samples"));
  EXPECT_EQ(Ask("posterior c1 --json", "").out, posterior);
  int kept = 0;
  for (int sample = 0; sample < 4; ++sample) {
    kept += Ask("states c1 " + std::to_string(sample), "").code == 0 ? 1 : 0;
  }
  EXPECT_EQ(kept, 1);
  EXPECT_EQ(Call("prune --keep-states -1 --server " + address_).code, 2);
}

TEST_F(Upkeep, LogsAreObjectsForMachinesAndFilesThatStaySmall) {
  {
    const auto server = Serve("state", {"--log-format", "json", "--log-mib", "1"});
    EXPECT_EQ(Ask("submit campaign.yaml", "").code, 0) << Read("err");
    server->Signal(SIGTERM);
    EXPECT_EQ(server->Wait(kPatience), 0);
  }
  std::istringstream log(Read("state.log"));
  std::vector<std::string> events;
  for (std::string line; std::getline(log, line);) {
    const Json json = Json::parse(line, nullptr, false);
    ASSERT_TRUE(json.is_object()) << line;
    EXPECT_EQ(json["time"].get<std::string>().back(), 'Z');
    events.push_back(json.value("event", "none: " + line));
    if (events.back() == "change") {
      EXPECT_EQ(json["of"], json["what"] == "submit" ? Json("c1") : json["of"]);
    }
  }
  EXPECT_THAT(events, ::testing::IsSupersetOf({"serving", "change", "shutdown"}));
  Process bad({Program("calibd"), "--state", At("other"), "--log-format", "xml"}, At("bad.err"));
  EXPECT_EQ(bad.Wait(kPatience), 2);
}

}  // namespace
}  // namespace calib::ctl
