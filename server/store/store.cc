#include "server/store/store.h"

#include <deque>
#include <future>
#include <thread>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "calib/return_if_error.h"
#include "server/store/connection.h"
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

  void Enqueue(Job job, Done done) {
    absl::MutexLock lock(&mutex_);
    queue_.push_back({.job = std::move(job), .done = std::move(done)});
  }

 private:
  struct Entry {
    Job job;
    Done done;
    absl::Status refused{};  ///< its own rows break a constraint; the others of its group stay
  };

  bool HasWork() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return closing_ || !queue_.empty(); }

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
        failure_ = Commit(group);
      }
      for (Entry& entry : group) {
        entry.done(failure_.ok() ? entry.refused : failure_);
      }
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

  absl::Status Commit(std::vector<Entry>& group) {
    try {
      const std::unique_ptr<SQLite::Transaction> scope = Begin();
      for (Entry& entry : group) {
        connection_->Run("SAVEPOINT job");
        Transaction transaction(*connection_);
        entry.job(transaction);
        if (absl::IsInvalidArgument(transaction.status())) {
          connection_->Run("ROLLBACK TO job");
          entry.refused = transaction.status();
        } else if (!transaction.status().ok()) {
          return transaction.status();  // rolls back
        }
        connection_->Run("RELEASE job");
      }
      if (hooks_.before_commit) {
        RETURN_IF_ERROR(hooks_.before_commit());
      }
      scope->commit();
    } catch (const SQLite::Exception& error) {
      return ToStatus(error);
    }
    if (hooks_.after_commit) {
      hooks_.after_commit();
    }
    return absl::OkStatus();
  }

  const std::unique_ptr<Connection> connection_;  // the writer thread's alone
  const StoreHooks hooks_;
  absl::Status failure_;  // the writer thread's alone
  absl::Mutex mutex_;
  std::deque<Entry> queue_ ABSL_GUARDED_BY(mutex_);
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;  // last: starts when everything above is there
};

namespace {

absl::Status At(const std::string& path, const absl::Status& status) {
  return {status.code(), absl::StrCat(path, ": ", status.message())};
}

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> Store::Open(const std::string& path, StoreHooks hooks) {
  std::unique_ptr<Connection> connection;
  try {
    connection = std::make_unique<Connection>(path, /*writable=*/true);
  } catch (const SQLite::Exception& error) {
    return At(path, ToStatus(error));
  }
  if (absl::Status status = Migrate(*connection); !status.ok()) {
    return At(path, status);
  }
  return std::unique_ptr<Store>(
      new Store(path, std::make_unique<Writer>(std::move(connection), std::move(hooks))));
}

Store::Store(std::string path, std::unique_ptr<Writer> writer)
    : path_(std::move(path)), writer_(std::move(writer)) {}

Store::~Store() = default;

void Store::Write(Job job, Done done) { writer_->Enqueue(std::move(job), std::move(done)); }

absl::Status Store::WriteNow(Job job) {
  std::promise<absl::Status> result;
  Write(std::move(job), [&result](const absl::Status& status) { result.set_value(status); });
  return result.get_future().get();
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
