#pragma once
// What may be written: the verbs of the domain, all of one Write() in one SQLite transaction
// (store.h).

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/store/numbers.h"
#include "server/store/records.h"

namespace calib::store {

class Connection;

/// Handed to the function given to Store::Write, on the store's thread. Errors stick: after the
/// first one nothing more is written, and the whole of this Write is rolled back (store.h: what
/// else is).
class Transaction {
 public:
  explicit Transaction(Connection& connection) : connection_(connection) {}
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  const absl::Status& status() const { return status_; }
  /// Whether what is in the log beside the file is to be brought into it after the commit.
  bool empties_log() const { return empties_log_; }
  /// What has been written so far.
  const Tally& tally() const { return tally_; }

  /// Content under its digest; a second copy changes nothing.
  void PutBlob(const std::string& digest, const std::string& content);
  /// Fills a piece of a content, from this byte on; false: it cannot be had any more, and the write
  /// is refused.
  using Piece = std::function<bool(std::int64_t from, std::span<char> to)>;
  /// The same of a content of this many bytes, piece by piece, so that it is never whole in memory.
  void PutBlob(const std::string& digest, std::int64_t bytes, const Piece& piece);
  /// Remembers the answer to a request so that its repetition gets the same one.
  void PutRequest(const std::string& id, const RequestRecord& request);
  /// files: path -> digest of a stored blob.
  void InsertCampaign(const NewCampaign& campaign, const std::map<std::string, std::string>& files);
  void SetProgress(std::int64_t campaign, const CampaignProgress& progress);
  /// Of its progress state and reason alone.
  void SetState(std::int64_t campaign, CampaignState state, const std::string& reason);
  void SetPriority(std::int64_t campaign, int priority);
  /// Slots that the runs of an owner hold at most, >= 0; empty: no bound.
  void SetQuota(const std::string& owner, std::optional<int> slots);
  /// Whatever else is stored of its progress stays.
  void Pause(std::int64_t campaign, const std::string& reason);
  /// Requests that were given this answer are new again.
  void ForgetRequests(const std::string& answer);
  /// From now on nobody sees the campaign; what belongs to it leaves by Remove().
  void DeleteCampaign(std::int64_t campaign);
  /// From now on a campaign that is over has the states of the samples of largest weight alone, so
  /// many or as few as it was pruned to before; the others leave by Remove(). Whether that is less
  /// than it had.
  bool Prune(std::int64_t campaign, int kept);
  /// Removes at most so many rows of what leaves.
  Removed Remove(int rows);
  /// Removes a content that nothing names and that was put before this moment, if at all.
  void RemoveBlob(const std::string& digest, std::int64_t put_before_unix_s);
  /// Gives at most so many empty pages of the file back to the file system; with the last ones the
  /// file becomes smaller.
  Removed ReturnPages(int pages);

  void InsertIteration(std::int64_t campaign, int number, const std::string& proposal);
  /// Replaces the proposal of an iteration that goes on growing.
  void SetProposal(std::int64_t campaign, int number, const std::string& proposal);
  void SetPosterior(std::int64_t campaign, int number, const std::string& posterior);
  void InsertSample(std::int64_t campaign, const SampleRecord& sample);
  void SetWeight(std::int64_t campaign, int sample, double log_weight, double log_likelihood);
  /// See SampleRecord::stop_below.
  void SetStopBelow(std::int64_t campaign, int sample, double stop_below);
  /// From now on this sample is run to its end.
  void NeverStop(std::int64_t campaign, int sample);
  /// Marks a stopped sample that is run to its end to see what stopping it would have lost. share:
  /// see SampleRecord::audited.
  void Audit(std::int64_t campaign, int sample, double share);
  void InsertEvaluation(const EvaluationRecord& evaluation);
  void SetEvaluation(const EvaluationKey& key, EvaluationStatus status, const std::string& reason,
                     int failures);
  /// See EvaluationRecord::losses.
  void SetLosses(const EvaluationKey& key, int losses);
  /// The next attempt of the evaluation rests after this load step; empty: it runs to the end.
  void SetRest(const EvaluationKey& key, std::optional<int> rest_after);
  /// The evaluation rests, and workers with this checkpoint folder can go on with it.
  void SetHeldIn(const EvaluationKey& key, const std::string& folder);
  /// Forgets what has been computed of an evaluation, which from now on is this one and waits.
  void BeginAnew(const EvaluationKey& key, const std::string& digest);
  /// Ends `to` as `from` ended and gives it the same states; counted as reused.
  void ReuseEvaluation(const EvaluationKey& from, const EvaluationKey& to);

  void InsertAttempt(const NewAttempt& attempt);
  void EndAttempt(const AttemptEnd& end);
  /// Ends those of a campaign that have not ended, as `end` says but for its id.
  void EndOpenAttempts(std::int64_t campaign, const AttemptEnd& end);
  /// A state that is there already is left alone; if its bits differ, that is logged as
  /// nondeterminism.
  void PutState(const StateRecord& state, std::int64_t unix_ms);

  /// A document that was put as a blob speaks of the campaign; said again it is the last one again,
  /// with its first date. Changes nothing where one of them is gone.
  void PutFinding(std::int64_t campaign, const FindingRecord& finding);

  /// A backup was taken whole.
  void LogBackup(std::int64_t unix_ms) { Log(0, unix_ms, kBackupEvent); }

  /// campaign 0: concerns the server as a whole.
  void Log(std::int64_t campaign, std::int64_t unix_ms, const std::string& what);

 private:
  /// Runs `write` unless an earlier one failed; SQLite's exceptions end here.
  template <typename F>
  void Guard(F write);

  Connection& connection_;
  absl::Status status_;
  Tally tally_;
  bool empties_log_ = false;
};

}  // namespace calib::store
