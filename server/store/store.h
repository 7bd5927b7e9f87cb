#pragma once
// The campaign state on disk: one SQLite file, one writer on one thread, any number of readers.

#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/store/reader.h"
#include "server/store/transaction.h"

namespace calib::store {

/// Called on the store's thread around every commit; tests kill or fail the process there.
struct StoreHooks {
  std::function<absl::Status()> before_commit{};
  std::function<void()> after_commit{};
};

/// Thread-safe. Writes are executed in the order of Write(); those that wait while a commit reaches
/// the disk go together into the next one (group commit). A job whose rows break a constraint is
/// rolled back alone and gets INVALID_ARGUMENT. After the first failed commit (full disk, I/O
/// error) nothing is written any more and every Write() reports that failure: what was acknowledged
/// stays readable, the program must start again.
class Store {
 public:
  using Job = std::function<void(Transaction&)>;
  using Done = std::function<void(const absl::Status&)>;

  /// Creates or migrates the file. Errors: FAILED_PRECONDITION (written by a newer program),
  /// RESOURCE_EXHAUSTED (cannot be written), DATA_LOSS (not a database).
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& path,
                                                     StoreHooks hooks = {});
  /// Finishes what was queued.
  ~Store();
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  /// `job` runs on the store's thread; then `done` does, with OK only once the job is on disk. Both
  /// must be short.
  void Write(Job job, Done done);
  /// Write() that waits. Not to be called from a Job or Done.
  absl::Status WriteNow(Job job);

  absl::StatusOr<Reader> Read() const;

 private:
  class Writer;
  Store(std::string path, std::unique_ptr<Writer> writer);

  std::string path_;
  std::unique_ptr<Writer> writer_;
};

}  // namespace calib::store
