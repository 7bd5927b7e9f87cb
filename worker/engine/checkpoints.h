#pragma once
// What runs that rest go on from, in a folder that several workers of one machine may share.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

namespace calib::worker {

/// A run that rests.
struct HeldRun {
  std::int64_t steps = 0;  ///< made so far, by all its attempts
  std::int64_t contact_updates = 0;
  std::string checkpoint{};  ///< what dem::Simulate goes on from
};

/// Files by digest of their run. A file that is lost or damaged costs the time of its run, nothing
/// else: whoever does not find it begins anew. Thread-safe, also between processes.
class Checkpoints {
 public:
  /// Files that nobody has used for longer are removed: a run may rest for ever.
  static constexpr std::chrono::hours kLongestUnused{30 * 24};

  /// Makes the folder and gives it an identity. most_bytes: the files that were used longest ago
  /// give way. Files that nobody used for kLongestUnused go at once.
  /// Errors: UNAVAILABLE with the reason.
  static absl::StatusOr<Checkpoints> Open(const std::string& folder, std::int64_t most_bytes);

  /// A name that every process that opens this folder sees, and no other folder has.
  const std::string& identity() const { return identity_; }

  /// The run of this digest; empty: there is none, or it is unreadable.
  std::optional<HeldRun> Find(const std::string& run) const;
  /// Writes what a run that rests goes on from, under its digest. Errors: those of
  /// dem::WriteWholeFile.
  absl::Status Save(const std::string& run, const HeldRun& held) const;
  void Remove(const std::string& run) const;

 private:
  Checkpoints(std::string folder, std::string identity, std::int64_t most_bytes);
  std::string PathOf(const std::string& run) const;
  void MakeRoom() const;

  std::string folder_;
  std::string identity_;
  std::int64_t most_bytes_;
};

}  // namespace calib::worker
