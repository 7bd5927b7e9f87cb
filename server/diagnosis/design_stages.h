#pragma once
// The chain of a diagnosis: which batch of runs is next, until the answer. A pure function of the
// base campaign, the batches that are stored and the campaign's seed: interrupted after any batch,
// made by any number of workers, it ends with the same bits.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "server/diagnosis/answer.h"
#include "server/diagnosis/borrowed_design.h"
#include "server/diagnosis/design_answer.h"
#include "server/diagnosis/knowledge.h"
#include "server/diagnosis/run_maker.h"
#include "server/diagnosis/verification.h"

namespace calib::diagnosis {

/// What a diagnosis asks before it runs anything.
struct DesignQuestion {
  std::vector<std::string> without{};  ///< effects that are left out
  double level = 0.01;                 ///< of the adequacy test
  /// Whose runs the answer rests on, where they are to be those of another campaign's design.
  std::optional<OtherDesign> other{};
};

/// The next batch, or the answer.
using NextStep = std::variant<RunBatch, Answer>;

/// What an answer rests on. Pointers are into the chain, until a batch is added.
struct AnsweredDesign {
  const KnownBefore* before = nullptr;
  const Knowledge* known = nullptr;
  const Asked* asked = nullptr;  ///< with Effort::kToAnswer
  const std::vector<EndedBatch>* batches = nullptr;
  const campaign::Campaign* design = nullptr;  ///< CampaignOfDesign
  BaseMisfit misfit{};
  VerificationChances verification{};
  double level = 0.01;  ///< of the adequacy test
};

/// The chain, from the batches that it is told of. Where it rests on the runs of another design it
/// begins with its own sequential batches. Where the base's runs were made elsewhere it makes none
/// and answers at once, from them, those with effects that the same tables hold and what is
/// calculated on them. What it has found is kept as long as it lives. Not thread-safe.
class DesignChain {
 public:
  /// Errors: those of RaceOf, BaseRunsOf, RegionOf and BorrowedBatches: FAILED_PRECONDITION with a
  /// sentence, also where the other design was made for other runs (WhyOtherRuns).
  static absl::StatusOr<DesignChain> Create(const report::CampaignView& base,
                                            const DesignQuestion& question);

  const Race& race() const { return scout_rows_.race(); }
  /// Of the values of rows: DesignRows::names().
  const std::vector<std::string>& names() const { return scout_rows_.names(); }
  /// Runs of its own batches so far.
  int own_runs() const { return RunsIn(borrowed_, batches_.size()); }

  /// The next batch that was made. Errors: INVALID_ARGUMENT for one of a stage that cannot follow
  /// (none can where the base's runs were made elsewhere), or rows of another length.
  absl::Status Add(EndedBatch batch);
  /// What comes after the batches so far. Errors: those of Learn and Ask.
  absl::StatusOr<NextStep> Next();
  /// What the answer of Next() rests on. Errors: those of Next; FAILED_PRECONDITION while there is
  /// none.
  absl::StatusOr<AnsweredDesign> Answered();

 private:
  DesignChain(KnownBefore before, DesignRows scout_rows, campaign::Campaign design,
              std::vector<EndedBatch> borrowed, double level);

  /// Of its own batches, the main one where it has those of another design; empty: no batch yet.
  std::optional<campaign::SamplePurpose> LastStage() const;
  int BatchesOf(campaign::SamplePurpose stage, std::size_t from = 0) const;
  int RunsIn(std::size_t from, std::size_t to) const;
  /// What the first n batches say.
  absl::StatusOr<const Knowledge*> KnownAfter(std::size_t n);
  absl::StatusOr<const Asked*> AskedAfter(std::size_t n, Effort effort);

  RunBatch Scout() const;
  std::optional<RunBatch> ScoutAgain() const;
  absl::StatusOr<RunBatch> Main();
  absl::StatusOr<std::optional<RunBatch>> Sequential(std::size_t n);
  absl::StatusOr<std::optional<RunBatch>> Verification();
  /// Models whose fresh runs would follow the first n batches.
  absl::StatusOr<std::vector<VerifiedModel>> ToVerify(std::size_t n);
  /// By the first n batches.
  absl::StatusOr<Answer> AnswerAfter(std::size_t n, const VerificationChances& verification);
  /// The answer by the first n batches, which is the last word.
  absl::StatusOr<NextStep> Ended(std::size_t n, const VerificationChances& verification);
  absl::StatusOr<NextStep> EndedElsewhere();
  RunBatch BatchOf(campaign::SamplePurpose stage, std::vector<campaign::RunOf> rows) const;
  int NextStream() const;

  KnownBefore before_;
  DesignRows scout_rows_;
  campaign::Campaign design_;
  double level_;
  std::optional<VerificationChances> verification_;  ///< of the answer, once there is one
  std::vector<EndedBatch> batches_;                  ///< those of another design first
  std::size_t borrowed_ = 0;          ///< how many come first: of others, or held by tables
  int first_stream_ = 0;              ///< of its own runs
  std::optional<BaseMisfit> misfit_;  ///< by the scout's numerics, which later batches leave alone
  std::optional<DesignRows> units_;   ///< where no scout is made: by what there is at first
  std::map<std::size_t, Knowledge> known_;
  std::map<std::pair<std::size_t, Effort>, Asked> asked_;
};

/// Asks the chain and has its batches made until there is an answer. Errors: those of both;
/// RESOURCE_EXHAUSTED before a batch with which there would be more than most_runs.
absl::StatusOr<Answer> AnswerBy(DesignChain& chain, RunMaker& maker,
                                std::optional<std::int64_t> most_runs = std::nullopt);

/// The adequacy of the base model alone, by the errors and the emulator of its own runs: verdict
/// adequate or unexplained, nobody in the race and no probabilities. Errors: those of BaseRunsOf,
/// RegionOf, MisfitOfBase.
absl::StatusOr<Answer> AdequacyOf(const report::CampaignView& base, double level);

}  // namespace calib::diagnosis
