#include "server/store/store.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <filesystem>
#include <future>
#include <iterator>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/return_if_error.h"
#include "server/store/connection.h"
#include "server/store/migration_backup.h"
#include "server/store/migrations.h"

namespace calib::store {
namespace {

/// Bounds how long one transaction keeps earlier acknowledgements waiting.
constexpr std::size_t kLargestGroup = 512;
constexpr int kBusyTries = 24;  // each waits for the busy timeout of a connection, 5 s

}  // namespace

class Store::Writer {
 public:
  Writer(std::unique_ptr<Connection> connection, StoreHooks hooks)
      : connection_(std::move(connection)), hooks_(std::move(hooks)), thread_([this] { Loop(); }) {}

  ~Writer() {
    {
      absl::MutexLock lock(&mutex_);
      closing_ = true;
    }
    thread_.join();
  }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  struct Entry {
    Job job;
    Done done;
    bool waits_for_room = true;
    absl::Status refused{};  ///< it is not written, for a reason of its own; the others are
  };

  void Enqueue(std::vector<Asked> together) {
    absl::MutexLock lock(&mutex_);
    for (Asked& asked : together) {
      queue_.push_back({.job = std::move(asked.job),
                        .done = std::move(asked.done),
                        .waits_for_room = asked.waits_for_room});
    }
  }
  void Watch(OnRoom on_room) {
    absl::MutexLock lock(&mutex_);
    on_room_ = std::move(on_room);
  }
  void StopWaiting() {
    absl::MutexLock lock(&mutex_);
    waits_no_more_ = true;
  }
  StoreNumbers Numbers() {
    absl::MutexLock lock(&mutex_);
    return {.written = written_, .commits = commits_.Read(), .waiting = queue_.size()};
  }

 private:
  bool HasWork() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return closing_ || !queue_.empty(); }
  bool IsEnding() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return closing_ || waits_no_more_; }

  /// What waits, up to a full group; empty: closing and all done.
  std::vector<Entry> NextGroup() {
    absl::MutexLock lock(&mutex_);
    mutex_.Await(absl::Condition(this, &Writer::HasWork));
    std::vector<Entry> group;
    while (!queue_.empty() && group.size() < kLargestGroup) {
      group.push_back(std::move(queue_.front()));
      queue_.pop_front();
    }
    return group;
  }

  void Loop() {
    for (auto group = NextGroup(); !group.empty(); group = NextGroup()) {
      if (failure_.ok()) {
        failure_ = CommitOnceThereIsRoom(group);
      }
      for (Entry& entry : group) {
        entry.done(failure_.ok() ? entry.refused : failure_);
      }
      group.clear();  // what the jobs hold, as the files of uploads, goes now
    }
  }

  /// Whether it is to end within this time. By naps: a timed wait of absl::Mutex goes by the wall
  /// clock, and lasts as much longer as that is set back meanwhile.
  bool EndsWithin(std::chrono::milliseconds time) {
    constexpr absl::Duration kNap = absl::Milliseconds(20);
    const auto until = std::chrono::steady_clock::now() + time;
    for (;;) {
      {
        absl::MutexLock lock(&mutex_);
        if (IsEnding()) return true;
      }
      const auto left = absl::FromChrono(until - std::chrono::steady_clock::now());
      if (left <= absl::ZeroDuration()) return false;
      absl::SleepFor(std::min(kNap, left));
    }
  }

  /// Tries again for as long as the disk has no room; CANCELLED: that was not to be waited for.
  absl::Status CommitOnceThereIsRoom(std::vector<Entry>& group) {
    absl::Status status = Commit(group);
    if (absl::IsResourceExhausted(status) && RefuseThoseThatDoNotWait(group, status)) {
      status = group.empty() ? absl::OkStatus() : Commit(group);
    }
    if (!absl::IsResourceExhausted(status)) {
      return status;
    }
    Tell(status);
    while (absl::IsResourceExhausted(status)) {
      if (EndsWithin(hooks_.between_tries)) {
        return absl::CancelledError(
            absl::StrCat("not written, for the server ends: ", status.message()));
      }
      std::vector<Entry> refused;
      {
        absl::MutexLock lock(&mutex_);
        const auto waiting = std::stable_partition(
            queue_.begin(), queue_.end(), [](const Entry& entry) { return !entry.waits_for_room; });
        std::move(queue_.begin(), waiting, std::back_inserter(refused));
        queue_.erase(queue_.begin(), waiting);
      }
      RefuseThoseThatDoNotWait(refused, status);
      status = Commit(group);
    }
    if (status.ok()) {
      Tell(status);
    }
    return status;
  }

  /// Those that do not wait for room are told so at once, and are of the group no more. Whether
  /// there were any.
  static bool RefuseThoseThatDoNotWait(std::vector<Entry>& group, const absl::Status& why) {
    return std::erase_if(group, [&why](const Entry& entry) {
             if (!entry.waits_for_room) {
               entry.done(absl::IsInvalidArgument(entry.refused) ? entry.refused : why);
             }
             return !entry.waits_for_room;
           }) > 0;
  }

  void Tell(const absl::Status& room) {
    OnRoom on_room;
    {
      absl::MutexLock lock(&mutex_);
      on_room = on_room_;
    }
    if (on_room) {
      on_room(room);
    }
  }

  /// While somebody else holds the file's lock (a backup, a shell), waits; nothing is begun by
  /// then.
  std::unique_ptr<SQLite::Transaction> Begin() {
    for (int i = 1;; ++i) {
      try {
        return std::make_unique<SQLite::Transaction>(connection_->database(),
                                                     SQLite::TransactionBehavior::IMMEDIATE);
      } catch (const SQLite::Exception& error) {
        if (!absl::IsUnavailable(ToStatus(error)) || i == kBusyTries) throw;
      }
    }
  }

  /// A savepoint around each job costs up to half as much again, and a row that is refused is rare:
  /// a group is written as one, and job by job where that does not go.
  absl::Status Commit(std::vector<Entry>& group) {
    const absl::Status status = CommitAs(group, Refusing::kAll);
    return absl::IsInvalidArgument(status) ? CommitAs(group, Refusing::kOne) : status;
  }

  /// What is undone where rows of a job are refused: the whole group (INVALID_ARGUMENT), or that
  /// job alone.
  enum class Refusing { kAll, kOne };
  absl::Status CommitAs(std::vector<Entry>& group, Refusing refusing) {
    const bool alone = refusing == Refusing::kOne;
    const auto begun = std::chrono::steady_clock::now();
    Tally written;
    bool empties_log = false;
    try {
      const std::unique_ptr<SQLite::Transaction> scope = Begin();
      for (Entry& entry : group) {
        if (alone) connection_->Run("SAVEPOINT job");
        Transaction transaction(*connection_);
        entry.job(transaction);
        entry.refused = absl::OkStatus();  // of a try before this one
        if (alone && absl::IsInvalidArgument(transaction.status())) {
          connection_->Run("ROLLBACK TO job");
          entry.refused = transaction.status();
        } else if (!transaction.status().ok()) {
          return transaction.status();  // rolls back
        } else {
          written.Add(transaction.tally());
          empties_log = empties_log || transaction.empties_log();
        }
        if (alone) connection_->Run("RELEASE job");
      }
      if (hooks_.before_commit) {
        RETURN_IF_ERROR(hooks_.before_commit());
      }
      scope->commit();
    } catch (const SQLite::Exception& error) {
      return connection_->StatusOf(error);
    }
    commits_.Add(std::chrono::steady_clock::now() - begun);
    {
      absl::MutexLock lock(&mutex_);
      written_.Add(written);
    }
    if (hooks_.after_commit) {
      hooks_.after_commit();
    }
    if (empties_log) {
      EmptyLog();
    }
    return absl::OkStatus();
  }

  /// As far as no reader needs it; waits for nobody.
  void EmptyLog() {
    try {
      connection_->database().exec("PRAGMA wal_checkpoint(PASSIVE)");
    } catch (const SQLite::Exception&) {
      // what was committed is safe, and the next commits try again
    }
  }

  const std::unique_ptr<Connection> connection_;  // the writer thread's alone
  const StoreHooks hooks_;
  absl::Status failure_;  // the writer thread's alone
  absl::Mutex mutex_;
  std::deque<Entry> queue_ ABSL_GUARDED_BY(mutex_);
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  bool waits_no_more_ ABSL_GUARDED_BY(mutex_) = false;
  OnRoom on_room_ ABSL_GUARDED_BY(mutex_);
  Tally written_ ABSL_GUARDED_BY(mutex_);
  Durations commits_;
  std::thread thread_;  // last: starts when everything above is there
};

namespace {

/// A file of an earlier program is written once more, so that its empty pages can go back to the
/// file system. Where there is no room for that, they stay and are used again.
absl::Status LearnToGiveBack(Connection& connection) {
  try {
    if (connection.database().execAndGet("PRAGMA auto_vacuum").getInt() == 0) {
      connection.database().exec("PRAGMA auto_vacuum=INCREMENTAL");
      connection.database().exec("VACUUM");
    }
    return absl::OkStatus();
  } catch (const SQLite::Exception& error) {
    const absl::Status status = connection.StatusOf(error);
    return absl::IsResourceExhausted(status) ? absl::OkStatus() : status;
  }
}

absl::Status At(const std::string& path, const absl::Status& status) {
  return {status.code(), absl::StrCat(path, ": ", status.message())};
}

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> Store::Open(const std::string& path, StoreHooks hooks) {
  auto connection = Connection::Open(path, /*writable=*/true);
  absl::Status status = connection.status();
  if (status.ok()) {
    status = BackUpBeforeMigration(**connection, path);
  }
  if (status.ok()) {
    status = Migrate(**connection);
  }
  if (status.ok()) {
    status = LearnToGiveBack(**connection);
  }
  if (!status.ok()) {
    return At(path, status);
  }
  return std::unique_ptr<Store>(
      new Store(path, std::make_unique<Writer>(*std::move(connection), std::move(hooks))));
}

Store::Store(std::string path, std::unique_ptr<Writer> writer)
    : path_(std::move(path)), writer_(std::move(writer)) {}

Store::~Store() = default;

void Store::Write(Job job, Done done) {
  writer_->Enqueue({{.job = std::move(job), .done = std::move(done)}});
}

void Store::WriteIfRoom(Job job, Done done) {
  writer_->Enqueue({{.job = std::move(job), .done = std::move(done), .waits_for_room = false}});
}

void Store::Write(std::vector<Asked> together) { writer_->Enqueue(std::move(together)); }

void Store::Watch(OnRoom on_room) { writer_->Watch(std::move(on_room)); }

void Store::StopWaiting() { writer_->StopWaiting(); }

absl::Status Store::WriteNow(Job job) {
  std::promise<absl::Status> result;
  Write(std::move(job), [&result](const absl::Status& status) { result.set_value(status); });
  return result.get_future().get();
}

StoreNumbers Store::Numbers() const {
  StoreNumbers numbers = writer_->Numbers();
  const auto size = [](const std::string& path) {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(path, error);
    return error ? std::int64_t{0} : static_cast<std::int64_t>(bytes);
  };
  numbers.file_bytes = size(path_);
  numbers.wal_bytes = size(path_ + "-wal");
  return numbers;
}

absl::StatusOr<Reader> Store::Read() const {
  try {
    auto connection = std::make_unique<Connection>(path_, /*writable=*/false);
    connection->database().exec("BEGIN");
    return Reader(std::move(connection));
  } catch (const SQLite::Exception& error) {
    return ToStatus(error);
  }
}

}  // namespace calib::store
