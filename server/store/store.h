#pragma once
// The campaign state on disk: one SQLite file, one writer on one thread, any number of readers.

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/store/numbers.h"
#include "server/store/reader.h"
#include "server/store/transaction.h"

namespace calib::store {

/// Called on the store's thread around every try of a commit; tests kill or fail the process there.
struct StoreHooks {
  /// RESOURCE_EXHAUSTED: as if the disk were full.
  std::function<absl::Status()> before_commit{};
  std::function<void()> after_commit{};
  std::chrono::milliseconds between_tries{1000};  ///< while the disk is full
};

/// Thread-safe. Writes are executed in the order of Write(); those that wait while a commit reaches
/// the disk go together into the next one (group commit). A job whose rows break a constraint is
/// rolled back alone and gets INVALID_ARGUMENT. While the disk has no room the group is rolled back
/// as a whole and tried again until there is some: nothing of it is acknowledged meanwhile, and
/// what is in the file can be read. After any other failed commit (I/O error) nothing is written
/// any more and every Write() reports that failure: what was acknowledged stays readable, the
/// program must start again.
class Store {
 public:
  /// May run more than once: what it wrote is rolled back in between.
  using Job = std::function<void(Transaction&)>;
  using Done = std::function<void(const absl::Status&)>;
  /// Why writing waits: RESOURCE_EXHAUSTED in SQLite's words; OK: it goes on.
  using OnRoom = std::function<void(const absl::Status&)>;

  /// Creates the file, or migrates it after a copy has been made of it (migration_backup.h).
  /// Errors: FAILED_PRECONDITION (written by a newer program), RESOURCE_EXHAUSTED (no room on the
  /// disk), PERMISSION_DENIED (cannot be written), DATA_LOSS (not a database).
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& path,
                                                     StoreHooks hooks = {});
  /// Finishes what was queued, but for what the disk has no room for.
  ~Store();
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  /// `job` runs on the store's thread; then `done` does, with OK only once the job is on disk. Both
  /// must be short.
  void Write(Job job, Done done);
  /// The same of a job that nothing else depends on: where the disk has no room it is not tried
  /// again but gets RESOURCE_EXHAUSTED, within one pause between tries and before those that wait:
  /// neither waits for the other.
  void WriteIfRoom(Job job, Done done);
  /// A write that is asked for with others.
  struct Asked {
    Job job;
    Done done;
    bool waits_for_room = true;  ///< as of Write(), else as of WriteIfRoom()
  };
  /// These in their order, in one commit where nothing hinders it.
  void Write(std::vector<Asked> together);
  /// Write() that waits. Not to be called from a Job or Done.
  absl::Status WriteNow(Job job);

  /// `on_room` is called on the store's thread when writing begins to wait for room, and when it
  /// goes on, before the Done of what was written then. Before the first Write().
  void Watch(OnRoom on_room);
  /// From now on nothing waits for room: what finds none gets CANCELLED, and so does all after it.
  void StopWaiting();

  const std::string& path() const { return path_; }
  absl::StatusOr<Reader> Read() const;
  StoreNumbers Numbers() const;

 private:
  class Writer;
  Store(std::string path, std::unique_ptr<Writer> writer);

  std::string path_;
  std::unique_ptr<Writer> writer_;
};

}  // namespace calib::store
