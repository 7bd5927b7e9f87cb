#pragma once
// Where programs run: a folder per run, and what they bring along. POSIX.

#include <google/protobuf/repeated_ptr_field.h>

#include <cstdint>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "calib/v1/worker.pb.h"
#include "worker/program/fetch.h"

namespace calib::worker {

/// calib-UID-NAME in $TMPDIR, or in /tmp; '/' in the name becomes '_'.
std::string DefaultScratchRoot(const std::string& name);

/// OK: a file of this name stands in the folder of a run and nowhere else. INVALID_ARGUMENT: it is
/// empty or absolute, or has a part that is "..", "." or empty.
absl::Status CheckFileName(const std::string& name);

/// Bytes that the files below a folder take up; links are not followed.
double BytesBelow(const std::string& folder);

/// Replaces a file as a whole: whoever reads it sees the old or the new. UNAVAILABLE: the disk does
/// not take it.
absl::Status WriteFileBelow(const std::string& path, const std::string& content);

/// A folder that goes with this object, whatever is in it.
class RunFolder {
 public:
  RunFolder() = default;
  explicit RunFolder(std::string path) : path_(std::move(path)) {}
  ~RunFolder();
  RunFolder(RunFolder&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  RunFolder& operator=(RunFolder&& other) noexcept;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// The folder of one worker process in a root that several may share. It holds a lock on it as long
/// as it lives; folders that nobody holds are removed when another one opens the root. Files are
/// fetched once for all slots and checked by their digest. Thread-safe.
class Scratch {
 public:
  static constexpr double kMostCacheBytes = 4e9;

  /// Makes the root (for its owner alone) and a folder in it. Above most_cache_bytes the files that
  /// were used longest ago are fetched anew. UNAVAILABLE: it cannot be made, or it is of another
  /// account.
  static absl::StatusOr<std::unique_ptr<Scratch>> Open(const std::string& root, Fetch fetch,
                                                       double most_cache_bytes = kMostCacheBytes);
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  const std::string& root() const { return root_; }

  /// An empty folder. UNAVAILABLE: it cannot be made.
  absl::StatusOr<RunFolder> MakeRunFolder();

  using Files = google::protobuf::RepeatedPtrField<v1::ProgramFile>;
  /// Copies files into a folder, those that are no templates. Errors: INVALID_ARGUMENT (a name that
  /// leaves the folder, or stands twice), those of the fetch, DATA_LOSS (what was fetched has
  /// another digest), UNAVAILABLE (the disk), CANCELLED (stop).
  absl::Status CopyFiles(const Files& files, const std::string& folder, std::stop_token stop);
  /// Writes the templates among them, {NAME} replaced (request.h). Errors as above.
  absl::Status WriteTemplates(const Files& files,
                              const std::map<std::string, std::string>& replacements,
                              const std::string& folder, std::stop_token stop);

 private:
  /// A content that is there or on its way.
  struct Cached {
    bool there = false;
    int users = 0;  // that read it now: it does not give way
    double bytes = 0;
    std::int64_t last_use = 0;
  };
  class Pinned;

  Scratch(std::string root, std::string folder, int lock, Fetch fetch, double most_cache_bytes);
  /// The content of a digest, as a file that stays as long as the answer. A slot that finds it
  /// being fetched waits; one whose fetch failed leaves it to the next.
  absl::StatusOr<Pinned> Get(const std::string& digest, std::stop_token stop);
  /// Its size.
  absl::StatusOr<double> FetchInto(const std::string& path, const std::string& digest,
                                   std::stop_token stop);
  void MakeRoom() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::string PathOf(const std::string& digest) const;

  const std::string root_;
  const std::string folder_;
  const int lock_;
  const Fetch fetch_;
  const double most_cache_bytes_;
  absl::Mutex mutex_;
  absl::CondVar changed_;
  std::map<std::string, Cached> cache_ ABSL_GUARDED_BY(mutex_);
  std::int64_t uses_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t folders_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace calib::worker
