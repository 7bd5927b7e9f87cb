#pragma once
// What may be asked of the store. A Reader is one consistent picture of it, taken at its first
// query.

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "server/store/records.h"

namespace calib::store {

class Connection;

/// Over its own read-only connection; cheap enough to open one per request. Not thread-safe;
/// movable. Errors of every query: as the store's (connection.h). Collections are in the order of
/// their natural keys.
class Reader {
 public:
  explicit Reader(std::unique_ptr<Connection> connection);
  Reader(Reader&&) noexcept;
  Reader& operator=(Reader&&) noexcept;
  ~Reader();

  absl::StatusOr<std::vector<CampaignRecord>> Campaigns();
  /// At most `most` of them, those with a larger id than `after`; most 0: all.
  absl::StatusOr<std::vector<CampaignRecord>> Campaigns(std::int64_t after, int most);
  /// Ids and texts of those with a larger id than `after` whose text has this word.
  absl::StatusOr<std::vector<std::pair<std::int64_t, std::string>>> TextsWith(
      const std::string& word, std::int64_t after);
  /// NOT_FOUND when there is none.
  absl::StatusOr<CampaignRecord> Campaign(std::int64_t id);
  /// Largest id ever given to a campaign, deleted ones included; 0 when there was none.
  absl::StatusOr<std::int64_t> LastCampaign();
  absl::StatusOr<std::map<std::string, std::string>> Files(std::int64_t campaign);
  /// NOT_FOUND when there is none.
  absl::StatusOr<std::string> Blob(const std::string& digest);
  absl::StatusOr<bool> HasBlob(const std::string& digest);
  /// Bytes of a content; NOT_FOUND when there is none.
  absl::StatusOr<std::int64_t> BlobBytes(const std::string& digest);
  /// At most so many bytes of a content, from this byte on; fewer at its end. NOT_FOUND when there
  /// is none.
  absl::StatusOr<std::string> BlobPiece(const std::string& digest, std::int64_t from,
                                        std::int64_t bytes);
  absl::StatusOr<std::optional<RequestRecord>> Request(const std::string& id);

  absl::StatusOr<std::vector<IterationRecord>> Iterations(std::int64_t campaign);
  /// The samples with the number `first` or a larger one.
  absl::StatusOr<std::vector<SampleRecord>> Samples(std::int64_t campaign, int first = 0);
  /// Those of the samples with the number `first` or a larger one.
  absl::StatusOr<std::vector<EvaluationRecord>> Evaluations(std::int64_t campaign, int first = 0);
  /// Shows how the evaluations of the samples from `first` to `last` are, in the order of sample
  /// and experiment. rests: it is to stop before its end.
  absl::Status EachStatus(
      std::int64_t campaign, int first, int last,
      const std::function<void(int sample, EvaluationStatus status, bool rests)>& see);
  /// The states of one sample, or of all.
  absl::StatusOr<std::vector<StateRecord>> States(std::int64_t campaign,
                                                  std::optional<int> sample = std::nullopt);
  /// Shows the states of the samples from `first` to `last`, in the order of sample, experiment and
  /// load step, and keeps none of them. The observables are there during the call alone.
  absl::Status EachState(std::int64_t campaign, int first, int last,
                         const std::function<void(const EvaluationKey& key, int load_step,
                                                  std::span<const double> observables)>& see);
  /// The states of the samples with the number `first` or a larger one.
  absl::StatusOr<std::vector<StateRecord>> StatesFrom(std::int64_t campaign, int first);
  /// Of a campaign that was pruned: whether the states of this sample stay.
  absl::StatusOr<bool> KeepsStates(std::int64_t campaign, int sample);
  /// An evaluation that ended with a result (finished or diverged) and was determined by the same
  /// things.
  absl::StatusOr<std::optional<EvaluationKey>> FindEqual(const std::string& digest);

  absl::StatusOr<std::vector<ActiveAttempt>> ActiveAttempts();
  /// Largest id ever given to an attempt; 0 when there was none.
  absl::StatusOr<std::int64_t> LastAttempt();
  /// Attempts made so far, by sample.
  absl::StatusOr<std::map<int, int>> AttemptsBySample(std::int64_t campaign);
  /// What a program printed last on standard error where an attempt failed; the last such attempt.
  absl::StatusOr<std::map<int, std::string>> WordsBySample(std::int64_t campaign);
  /// Files of a program that stay with a sample, or were to, each with its experiment.
  absl::StatusOr<std::map<int, std::vector<std::pair<int, KeptFile>>>> KeptBySample(
      std::int64_t campaign);
  /// Core time of all attempts that ended [s], by evaluation; for an evaluation that was reused
  /// that of the equal one that ran, where it is still there. Evaluations of which nothing is known
  /// are left out. Of one sample, or of all.
  absl::StatusOr<std::map<EvaluationKey, double>> CoreSeconds(
      std::int64_t campaign, std::optional<int> sample = std::nullopt);
  absl::StatusOr<Effort> EffortOf(std::int64_t campaign);
  absl::StatusOr<std::vector<EventRecord>> Events(std::int64_t campaign);
  /// In the order in which they were last put.
  absl::StatusOr<std::vector<FindingRecord>> Findings(std::int64_t campaign);

  /// Slots that the runs of an owner hold at most, where that is bounded.
  absl::StatusOr<std::map<std::string, int>> Quotas();

  /// Contents that nothing names and that were put before this moment, if at all, with their bytes;
  /// at most so many.
  absl::StatusOr<std::vector<std::pair<std::string, std::int64_t>>> Unnamed(
      std::int64_t put_before_unix_s, int most);
  /// What is to be tidied.
  struct Upkeep {
    int leaving = 0;               ///< campaigns of which something is on its way out
    std::int64_t empty_bytes = 0;  ///< of the file
    bool gives_back = false;       ///< those to the file system
  };
  absl::StatusOr<Upkeep> UpkeepOf();
  /// A complete copy of what it sees, as CopyWhole() of whole_copy.h makes it.
  absl::Status CopyTo(const std::string& path, const std::function<bool()>& goes_on);
  /// When a backup was last taken whole; 0: never.
  absl::StatusOr<std::int64_t> LastBackupUnixMs();

  /// Looks through the whole file, at most this long.
  struct FileCheck {
    std::string fault;     ///< the first thing SQLite finds wrong; empty: nothing
    bool in_full = false;  ///< false: the time was up first
  };
  absl::StatusOr<FileCheck> CheckFile(std::chrono::milliseconds at_most);

 private:
  /// Runs `read`; SQLite's exceptions end here.
  template <typename F>
  auto Guard(F read) -> absl::StatusOr<decltype(read())>;

  struct BlobPlace {
    std::int64_t row = 0;
    std::int64_t bytes = 0;
  };
  absl::StatusOr<BlobPlace> FindBlob(const std::string& digest);

  std::unique_ptr<Connection> connection_;
};

}  // namespace calib::store
