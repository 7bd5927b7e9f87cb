// Real processes by seeds: killed, frozen, cut off, without room, at another hour, in any order and
// several at once. CALIB_SEEDS, CALIB_FIRST_SEED: how many storms, and the first.
#include "tests/fault/storm.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <numeric>
#include <random>
#include <sstream>

#include "server/service/state_folder.h"
#include "tests/fault/undisturbed.h"
#include "tests/support/proxy.h"
#include "tests/support/small_disk.h"

namespace calib::testing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr int kLease = 800;         // [ms]
constexpr int kDiskMebibytes = 32;  // a whole campaign takes some two
constexpr milliseconds kStarts{20'000};
constexpr int kSuite = 19;  // storms without CALIB_SEEDS, beside those that found a fault:
// 1032, a server whose disk was full when its clock was set waited for an hour.
constexpr std::array<std::uint64_t, 1> kFound = {1032};
constexpr const char* kFakeTime = "/usr/lib/x86_64-linux-gnu/faketime/libfaketimeMT.so.1";

std::uint64_t Number(const char* name, std::uint64_t standard) {
  const char* said = std::getenv(name);
  return said == nullptr ? standard : std::strtoull(said, nullptr, 10);
}

std::string TextOf(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// Whole, for who reads it at the same time.
void Replace(const std::string& file, const std::string& text) {
  std::ofstream(file + ".new") << text;
  fs::rename(file + ".new", file);
}

/// A sanitizer's runtime has to be the first library that is loaded.
bool ClockMayJump() { return CALIB_SLOWER == 1 && fs::exists(kFakeTime); }

/// A campaign of one server and two workers behind a proxy, and what is done to them.
class Storm {
 public:
  explicit Storm(bool own_mounts)
      : hour_(FreshFolder("hour") + "/offset"),
        deployment_({.name = "storm",
                     .lease_ms = kLease,
                     .heartbeat_ms = 100,
                     .server_environment = Environment(hour_)}) {
    Replace(hour_, "+0");
    if (own_mounts) disk_ = std::make_unique<SmallDisk>(deployment_.state(), kDiskMebibytes);
  }

  bool Begin() {
    if (!deployment_.StartServer()) return false;
    proxy_ = std::make_unique<Proxy>(deployment_.address());
    deployment_.SetAddressForWorkers(proxy_->address());
    deployment_.StartWorker();
    deployment_.StartWorker();
    Client client = deployment_.client();
    const SmallCampaign campaign = FaultCampaign();
    return client.SubmitCampaign(campaign.yaml, campaign.files, "r").ok();
  }

  /// All of it, each at its time, and all that was done undone.
  void Rage(const std::vector<Blow>& storm) {
    struct Event {
      milliseconds at;
      const Blow* blow;
      bool begins;
    };
    std::vector<Event> events;
    for (const Blow& blow : storm) {
      events.push_back({blow.at, &blow, true});
      events.push_back({blow.at + blow.lasts, &blow, false});
    }
    std::stable_sort(events.begin(), events.end(),
                     [](const Event& left, const Event& right) { return left.at < right.at; });
    const auto begun = std::chrono::steady_clock::now();
    for (const Event& event : events) {
      std::this_thread::sleep_until(begun + event.at);
      if (event.begins && Answers()) {
        Client client = deployment_.client();
        acknowledged_.merge(StatesNow(client));
      }
      event.begins ? Strike(*event.blow) : Mend(*event.blow);
      if (::testing::Test::HasFatalFailure()) return;
    }
  }

  void ExpectUnharmed() {
    ASSERT_TRUE(WaitFinished(deployment_)) << deployment_.Logs();
    ExpectUndisturbed(deployment_);
    Client client = deployment_.client();
    ExpectContains(StatesNow(client), acknowledged_);
  }

  const Deployment& deployment() const { return deployment_; }

 private:
  static std::vector<std::string> Environment(const std::string& hour) {
    if (!ClockMayJump()) return {};
    return {std::string("LD_PRELOAD=") + kFakeTime, "FAKETIME_TIMESTAMP_FILE=" + hour,
            "FAKETIME_CACHE_DURATION=1", "FAKETIME_DONT_FAKE_MONOTONIC=1", "DONT_FAKE_MONOTONIC=1"};
  }

  bool Answers() const { return down_ == 0 && frozen_ == 0; }

  Process& Worker(const Blow& blow) {
    std::vector<Process>& workers = deployment_.workers();
    return workers[workers.size() - 1 - blow.chance % 2];
  }

  void Strike(const Blow& blow) {
    switch (blow.fault) {
      case Fault::kServerKilled:
        if (down_++ == 0) deployment_.server().Kill();
        break;
      case Fault::kServerFrozen:
        if (frozen_++ == 0) deployment_.server().Signal(SIGSTOP);
        break;
      case Fault::kWorkerKilled:
        Worker(blow).Kill();
        deployment_.StartWorker();
        break;
      case Fault::kWorkerFrozen:
        Worker(blow).Signal(SIGSTOP);
        break;
      case Fault::kEngineKilled:
        KillAnEngine(blow);
        break;
      case Fault::kLinkCut:
        proxy_->Cut();
        break;
      case Fault::kLinkSlow:
        proxy_->SetDelay(milliseconds(20 + blow.chance % 400));
        break;
      case Fault::kLinkSilent:
        if (silent_++ == 0) proxy_->SetSilent(true);
        break;
      case Fault::kDiskFull:
        if (full_++ == 0) disk_->Fill();
        break;
      case Fault::kClockJumps:
        Replace(hour_, blow.chance % 2 == 0 ? "+3600" : "-3600");
        break;
      case Fault::kDamagedCopy:
        if (down_ == 0 && full_ == 0) ServeADamagedCopy(blow);
        break;
    }
  }

  void Mend(const Blow& blow) {
    switch (blow.fault) {
      case Fault::kServerKilled:
        if (--down_ > 0) break;
        if (full_ > 0) disk_->MakeRoom();  // none starts without
        ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
        if (frozen_ > 0) deployment_.server().Signal(SIGSTOP);
        break;
      case Fault::kServerFrozen:
        if (--frozen_ == 0 && down_ == 0) deployment_.server().Signal(SIGCONT);
        break;
      case Fault::kWorkerFrozen:
        for (const Process& worker : deployment_.workers()) worker.Signal(SIGCONT);
        break;
      case Fault::kLinkSlow:
        proxy_->SetDelay(milliseconds(0));
        break;
      case Fault::kLinkSilent:
        if (--silent_ == 0) proxy_->SetSilent(false);
        break;
      case Fault::kDiskFull:
        if (--full_ == 0) disk_->MakeRoom();
        break;
      case Fault::kWorkerKilled:
      case Fault::kEngineKilled:
      case Fault::kLinkCut:
      case Fault::kClockJumps:
      case Fault::kDamagedCopy:
        break;
    }
  }

  void KillAnEngine(const Blow& blow) {
    const std::string of = std::to_string(Worker(blow).id());
    std::ifstream children("/proc/" + of + "/task/" + of + "/children");
    if (pid_t child = 0; children >> child) kill(child, SIGKILL);
  }

  /// Such a server says what is wrong and goes, or serves what it can read; it never falls.
  void ServeADamagedCopy(const Blow& blow) {
    const std::string copy = deployment_.folder() + "/copy";
    fs::remove_all(copy);
    fs::create_directory(copy);
    fs::permissions(copy, fs::perms::owner_all);
    std::error_code gone;  // files of SQLite come and go
    for (const char* name : {"calib.db", "calib.db-wal"}) {
      fs::copy_file(deployment_.state() + "/" + name, copy + "/" + name, gone);
      fs::permissions(copy + "/" + name, fs::perms::owner_read | fs::perms::owner_write, gone);
    }
    const std::string damaged = copy + (blow.chance % 3 == 0 ? "/calib.db-wal" : "/calib.db");
    if (const auto size = fs::file_size(damaged, gone); !gone && size > 4096) {
      std::fstream file(damaged, std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(blow.chance / 3 % (size / 4096) * 4096));
      std::mt19937 noise(blow.chance);
      for (int k = 0; k < 1024; ++k) {
        const auto word = static_cast<std::uint32_t>(noise());
        file.write(reinterpret_cast<const char*>(&word), sizeof word);
      }
    }
    const std::string log = deployment_.folder() + "/copy.log";
    fs::remove(log, gone);
    Process server({Program("calibd"), "--state", copy, "--listen", "127.0.0.1:0"}, log);
    absl::StatusOr<std::string> address = absl::NotFoundError("");
    ASSERT_TRUE(Eventually(kStarts * CALIB_SLOWER, [&] {
      address = service::ServingAddress(copy);
      return address.ok() || !server.Running();
    })) << TextOf(log);
    if (address.ok()) {
      Client client(*address);
      for (const absl::Status& said : {client.Show("c1").status(), client.List().status(),
                                       client.Samples("c1").status(), client.States("c1").status()})
        EXPECT_TRUE(said.ok() || !said.message().empty());
      server.Signal(SIGTERM);
    }
    EXPECT_GE(server.Wait(kStarts * CALIB_SLOWER), 0) << "it fell\n" << TextOf(log);
    EXPECT_FALSE(TextOf(log).empty());
  }

  const std::string hour_;  // file with the offset of the server's clock
  Deployment deployment_;
  std::unique_ptr<SmallDisk> disk_;  // none: this account may mount nothing
  std::unique_ptr<Proxy> proxy_;
  std::set<std::string> acknowledged_;
  // How many faults of a kind go on.
  int down_ = 0, frozen_ = 0, silent_ = 0, full_ = 0;
};

TEST(Storm, LeavesEveryCampaignAsUndisturbed) {
  static const bool own_mounts = HaveOwnMounts();
  std::vector<Fault> faults = {Fault::kServerKilled, Fault::kServerFrozen, Fault::kWorkerKilled,
                               Fault::kWorkerFrozen, Fault::kEngineKilled, Fault::kLinkCut,
                               Fault::kLinkSlow,     Fault::kLinkSilent,   Fault::kDamagedCopy};
  if (own_mounts) {
    faults.push_back(Fault::kDiskFull);
  } else {
    std::cout << "full disks are left out: this account may mount nothing\n";
  }
  if (ClockMayJump()) {
    faults.push_back(Fault::kClockJumps);
  } else {
    std::cout << "jumps of the clock are left out: no libfaketime here, or a sanitizer\n";
  }
  ASSERT_FALSE(Undisturbed().empty());
  std::vector<std::uint64_t> seeds(Number("CALIB_SEEDS", kSuite));
  std::iota(seeds.begin(), seeds.end(), Number("CALIB_FIRST_SEED", 1));
  if (std::getenv("CALIB_SEEDS") == nullptr)
    seeds.insert(seeds.end(), kFound.begin(), kFound.end());
  for (const std::uint64_t seed : seeds) {
    const std::vector<Blow> blows = StormOf(seed, faults);
    SCOPED_TRACE("seed " + std::to_string(seed) + ": " + InWords(blows));
    const auto begun = std::chrono::steady_clock::now();
    Storm storm(own_mounts);
    ASSERT_TRUE(storm.Begin()) << storm.deployment().Logs();
    storm.Rage(blows);
    if (!HasFatalFailure()) storm.ExpectUnharmed();
    if (HasFailure()) {
      std::cout << storm.deployment().Logs();
      return;
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
    std::cout << "seed " << seed << ": " << took.count() << " s" << std::endl;
  }
}

}  // namespace
}  // namespace calib::testing
