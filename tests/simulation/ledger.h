#pragma once
// What has left a server is written down here, and held against what its disk has: at once, after
// every crash and at the end.

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "calib/v1/worker.pb.h"
#include "tests/simulation/crash_file_system.h"

struct sqlite3;

namespace calib::simulation {

/// Every check returns what is wrong, a sentence; empty: nothing is. Not thread-safe.
class Ledger {
 public:
  explicit Ledger(CrashFileSystem& disk) : disk_(disk) {}
  ~Ledger() { Close(); }
  Ledger(const Ledger&) = delete;
  Ledger& operator=(const Ledger&) = delete;

  /// The file of a server that has started.
  void Open(const std::string& path);
  void Close();

  // ---- what goes to and fro ----
  void Takes(const v1::WorkerMessage& message);
  std::string Sends(const std::string& worker, const v1::ServerMessage& message);
  /// A worker has computed so many states of an attempt.
  void Reached(std::int64_t attempt, int states) { reached_[attempt] = states; }
  /// A request that was carried out is remembered under this key.
  void Answered(const std::string& key) { requests_.insert(key); }
  void Submitted(std::int64_t campaign) { campaigns_.insert(campaign); }
  void Cancelled(std::int64_t campaign) { cancelled_.insert(campaign); }
  /// From now on nothing is known of it.
  void Deletes(std::int64_t campaign) { deleted_.insert(campaign); }

  /// All that was said to be on disk is.
  std::string Check();
  /// What the runs of a campaign that has finished have come to. resumed: by somebody, so that
  /// failures and losses are counted anew; goes_on: so do its plans.
  struct Finished {
    std::int64_t campaign = 0;
    bool resumed = false;
    bool goes_on = false;
  };
  std::string CheckEnd(const Finished& finished);

  std::string StateOf(std::int64_t campaign);
  /// Campaigns that are neither over nor deleted.
  std::vector<std::int64_t> Open();
  std::vector<std::int64_t> Paused();
  /// How its runs are, for people.
  std::string Summary(std::int64_t campaign);
  /// Brings the log beside the file into it.
  void EmptyLog();

 private:
  struct Key {
    std::int64_t campaign = -1, sample = 0, experiment = 0;
    auto operator<=>(const Key&) const = default;
  };
  struct Attempt {
    Key key{};
    std::string worker{};
    std::string outcome{};  ///< empty: it has not ended
  };
  using Row = std::vector<std::string>;
  std::vector<Row> Query(const std::string& sql);
  std::int64_t Number(const std::string& sql);
  /// campaign < 0: there is none.
  Attempt Find(std::int64_t attempt);
  std::string Acknowledges(const v1::Ack& ack);

  CrashFileSystem& disk_;
  sqlite3* database_ = nullptr;
  std::map<std::int64_t, int> reached_;
  std::map<std::int64_t, std::int64_t> said_;  // states of an attempt that were taken while it ran
  std::map<Key, std::int64_t> states_;         // acknowledged, from the first on
  std::map<std::int64_t, Key> ended_;          // attempts whose end was acknowledged
  std::set<std::int64_t> stale_;               // over when their workers' ends were taken
  std::set<std::string> requests_;
  std::set<std::int64_t> campaigns_, cancelled_, deleted_;
};

}  // namespace calib::simulation
