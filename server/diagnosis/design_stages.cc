#include "server/diagnosis/design_stages.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/diagnosis/next_runs.h"
#include "server/diagnosis/design_caps.h"
#include "server/diagnosis/held_runs.h"
#include "server/diagnosis/proposed_test.h"
#include "server/diagnosis/stage_rows.h"

namespace calib::diagnosis {
namespace {

using campaign::SamplePurpose;
using Eigen::Index;
using inference::DesignPoints;

double LargestMove(const inference::EffectProbabilities& a,
                   const inference::EffectProbabilities& b) {
  double most =
      std::max(std::abs(a.adequate - b.adequate), std::abs(a.none_of_these - b.none_of_these));
  for (Index k = 0; k < a.inclusion.size(); ++k)
    most = std::max(most, std::abs(a.inclusion[k] - b.inclusion[k]));
  return most;
}

}  // namespace

absl::StatusOr<DesignChain> DesignChain::Create(const report::CampaignView& base,
                                                const DesignQuestion& question) {
  if (question.other) {
    const report::CampaignView& other = *question.other->design;
    if (const std::string why = WhyOtherRuns(base.campaign, other.campaign); !why.empty()) {
      return absl::FailedPreconditionError(absl::StrCat("the runs of ", other.status.campaign(),
                                                        " are not of the tests and the model of ",
                                                        base.status.campaign(), ": ", why));
    }
  }
  ASSIGN_OR_RETURN(Race race, RaceOf(base, question.without));
  ASSIGN_OR_RETURN(BaseRuns runs, BaseRunsOf(base));
  inference::JointPrior prior = campaign::Priors(base.campaign);
  ASSIGN_OR_RETURN(BaseRegion region, RegionOf(runs, prior));
  if (question.other) {
    const report::CampaignView& other = *question.other->design;
    race = RaceWithin(std::move(race), other);
    if (race.effects.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat("the design ", other.status.campaign(), " has no effect that is asked for"));
    }
  }
  race = WithCalculated(race, runs);
  campaign::Campaign design = CampaignOfDesign(base.campaign, race);
  const Eigen::VectorXd unit = UnitsOfCatalogue(race);
  DesignRows rows(region.axes, std::move(race), unit);
  std::vector<EndedBatch> borrowed;
  if (question.other) {
    ASSIGN_OR_RETURN(const Race all, RaceOf(base, {}));
    ASSIGN_OR_RETURN(borrowed, BorrowedBatches(*question.other, all, rows, runs));
  }
  if (EndedBatch held = HeldRuns(base.campaign, rows, runs.samples); !held.runs.empty())
    borrowed.push_back(std::move(held));
  return DesignChain({.base = std::move(runs),
                      .region = std::move(region),
                      .prior = std::move(prior),
                      .seed = base.campaign.seed},
                     std::move(rows), std::move(design), std::move(borrowed), question.level);
}

DesignChain::DesignChain(KnownBefore before, DesignRows scout_rows, campaign::Campaign design,
                         std::vector<EndedBatch> borrowed, double level)
    : before_(std::move(before)),
      scout_rows_(std::move(scout_rows)),
      design_(std::move(design)),
      level_(level),
      batches_(std::move(borrowed)),
      borrowed_(batches_.size()),
      first_stream_(before_.base.samples) {
  for (const EndedBatch& batch : batches_) {
    for (const EndedRun& ended : batch.runs)
      first_stream_ = std::max(first_stream_, ended.run.stream + 1);
  }
}

absl::Status DesignChain::Add(EndedBatch batch) {
  const int before = static_cast<int>(LastStage().value_or(SamplePurpose::kEnsemble));
  const bool again = batch.stage == SamplePurpose::kSequential ||
                     (batch.stage == SamplePurpose::kScout && batches_.size() == 1);
  const bool first = batches_.empty() && batch.stage == SamplePurpose::kScout;
  const auto stage = static_cast<int>(batch.stage);
  if (before_.base.elsewhere || !campaign::IsStageOfDesign(batch.stage) ||
      batch.stage == SamplePurpose::kNumerics ||
      (!first && !(stage > before && !batches_.empty()) && !(again && stage == before)) ||
      (stage > static_cast<int>(SamplePurpose::kMain) && BatchesOf(SamplePurpose::kMain) == 0)) {
    return absl::InvalidArgumentError(absl::StrCat("a batch of the stage ",
                                                   campaign::ToString(batch.stage),
                                                   " cannot follow what the design holds"));
  }
  for (const EndedRun& run : batch.runs) {
    if (run.run.values.size() != names().size() ||
        (run.readings &&
         (run.readings->size() != before_.base.readings.cols() || !run.readings->allFinite())))
      return absl::InvalidArgumentError("a run of the design does not fit its campaign");
  }
  batches_.push_back(std::move(batch));
  verification_.reset();
  return absl::OkStatus();
}

std::optional<SamplePurpose> DesignChain::LastStage() const {
  if (batches_.size() > borrowed_) return batches_.back().stage;
  if (borrowed_ > 0) return SamplePurpose::kMain;
  return std::nullopt;
}

int DesignChain::BatchesOf(SamplePurpose stage, std::size_t from) const {
  return static_cast<int>(std::count_if(batches_.begin() + static_cast<std::ptrdiff_t>(from),
                                        batches_.end(),
                                        [stage](const auto& own) { return own.stage == stage; }));
}

int DesignChain::RunsIn(std::size_t from, std::size_t to) const {
  int runs = 0;
  for (std::size_t i = from; i < to; ++i) runs += static_cast<int>(batches_[i].runs.size());
  return runs;
}

int DesignChain::NextStream() const { return first_stream_ + own_runs(); }

absl::StatusOr<const Knowledge*> DesignChain::KnownAfter(std::size_t n) {
  if (const auto found = known_.find(n); found != known_.end()) return &found->second;
  const auto scouts = static_cast<std::size_t>(BatchesOf(SamplePurpose::kScout));
  const std::vector<EndedBatch> batches(batches_.begin(),
                                        batches_.begin() + static_cast<std::ptrdiff_t>(n));
  const DesignRows* guess = &scout_rows_;
  // Where no scout lies by itself what is there serves as one, once.
  const bool alone = before_.base.elsewhere || borrowed_ > 0;
  if (alone) {
    if (!units_) {
      const std::vector<EndedBatch> first(
          batches_.begin(), batches_.begin() + static_cast<std::ptrdiff_t>(borrowed_));
      ASSIGN_OR_RETURN(Knowledge known, Learn(before_, *guess, first, false));
      units_ = std::move(known.rows);
    }
    guess = &*units_;
  } else if (n > scouts) {
    ASSIGN_OR_RETURN(const Knowledge* scouted, KnownAfter(scouts));
    guess = &scouted->rows;
  }
  const bool with_flat = alone || n > scouts;
  ASSIGN_OR_RETURN(Knowledge known, Learn(before_, *guess, batches, with_flat));
  return &known_.emplace(n, std::move(known)).first->second;
}

absl::StatusOr<const Asked*> DesignChain::AskedAfter(std::size_t n, Effort effort) {
  if (const auto found = asked_.find({n, effort}); found != asked_.end()) return &found->second;
  ASSIGN_OR_RETURN(const Knowledge* known, KnownAfter(n));
  ASSIGN_OR_RETURN(Asked asked, Ask(before_, *known, effort));
  return &asked_.emplace(std::pair(n, effort), std::move(asked)).first->second;
}

RunBatch DesignChain::BatchOf(SamplePurpose stage, std::vector<campaign::RunOf> rows) const {
  return {.number = static_cast<int>(batches_.size() - borrowed_),
          .stage = stage,
          .rows = std::move(rows)};
}

RunBatch DesignChain::Scout() const {
  RunBatch batch = BatchOf(SamplePurpose::kScout,
                           AdmissibleRows(design_, scout_rows_, before_.region,
                                          ScoutPoints(scout_rows_, before_.region,
                                                      EntriesRun(race(), WholeOf(race()).kept), 1),
                                          NextStream()));
  for (campaign::RunOf& run : NumericsRows(scout_rows_, before_))
    batch.rows.push_back(std::move(run));
  return batch;
}

std::optional<RunBatch> DesignChain::ScoutAgain() const {
  std::vector<int> missing;
  for (const int k : EntriesRun(race(), WholeOf(race()).kept)) {
    if (RunsWith(scout_rows_, batches_, k) < kDesignCaps.scout_runs) missing.push_back(k);
  }
  if (missing.empty()) return std::nullopt;
  return BatchOf(SamplePurpose::kScout, AdmissibleRows(design_, scout_rows_, before_.region,
                                                       ScoutPoints(scout_rows_, before_.region,
                                                                   missing, kDesignCaps.weaker),
                                                       NextStream()));
}

absl::StatusOr<RunBatch> DesignChain::Main() {
  ASSIGN_OR_RETURN(const Knowledge* known, KnownAfter(batches_.size()));
  if (EntriesRun(race(), known->part.kept).empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "no effect can be tried: ", known->out.front().second, "; the tests stay unexplained"));
  }
  return BatchOf(SamplePurpose::kMain, AdmissibleRows(design_, known->rows, before_.region,
                                                      MainPoints(before_, *known), NextStream()));
}

absl::StatusOr<std::optional<RunBatch>> DesignChain::Sequential(std::size_t n) {
  const int made = BatchesOf(SamplePurpose::kSequential, borrowed_);
  if (made >= kDesignCaps.sequential_batches) return std::nullopt;
  ASSIGN_OR_RETURN(const Knowledge* known, KnownAfter(n));
  if (known->part.kept.empty()) return std::nullopt;
  ASSIGN_OR_RETURN(const Asked* asked, AskedAfter(n, Effort::kToChoose));
  if (made > 0) {
    ASSIGN_OR_RETURN(const Knowledge* known_before, KnownAfter(n - 1));
    ASSIGN_OR_RETURN(const Asked* asked_before, AskedAfter(n - 1, Effort::kToChoose));
    if (known->part.kept == known_before->part.kept &&
        LargestMove(asked->probabilities[0], asked_before->probabilities[0]) < kDesignCaps.moved)
      return std::nullopt;
  }
  const DesignPoints candidates = SequentialCandidates(*asked);
  ASSIGN_OR_RETURN(const inference::ChosenRuns chosen,
                   inference::NextRuns({.set = known->set.get(), .z = known->z}, asked->evidence[0],
                                       asked->probabilities[0], candidates,
                                       {.runs = kDesignCaps.sequential_runs}));
  if (chosen.information.back() < kDesignCaps.told) return std::nullopt;
  return BatchOf(SamplePurpose::kSequential,
                 AdmissibleRows(design_, known->rows, before_.region,
                                WholePoints(known->rows, known->part,
                                            inference::RowsOf(candidates, chosen.rows)),
                                NextStream()));
}

absl::StatusOr<std::optional<RunBatch>> DesignChain::Verification() {
  ASSIGN_OR_RETURN(const std::vector<VerifiedModel> models, ToVerify(batches_.size()));
  if (models.empty()) return std::nullopt;
  ASSIGN_OR_RETURN(const Knowledge* known, KnownAfter(batches_.size()));
  return BatchOf(SamplePurpose::kVerification,
                 AdmissibleRows(design_, known->rows, before_.region,
                                WholePoints(known->rows, known->part, VerificationPoints(models)),
                                NextStream()));
}

absl::StatusOr<std::vector<VerifiedModel>> DesignChain::ToVerify(std::size_t n) {
  ASSIGN_OR_RETURN(const Answer answer, AnswerAfter(n, std::nullopt));
  VerificationQuestion question{.most = kDesignCaps.verified_models,
                                .sibling = kDesignCaps.sibling};
  for (const EffectAnswer& own : answer.candidates) {
    if (own.alone) question.named.push_back(own.effect);
  }
  for (const NamedFamily& family : answer.families) question.families.push_back(family.effects);
  if (question.named.empty()) return std::vector<VerifiedModel>();
  ASSIGN_OR_RETURN(const Knowledge* known, KnownAfter(n));
  ASSIGN_OR_RETURN(const Asked* asked, AskedAfter(n, Effort::kToAnswer));
  return ModelsToVerify(*known, *asked, question);
}

absl::StatusOr<Answer> DesignChain::AnswerAfter(std::size_t n,
                                                const VerificationChances& verification) {
  ASSIGN_OR_RETURN(const Knowledge* known, KnownAfter(n));
  ASSIGN_OR_RETURN(const Asked* asked, AskedAfter(n, Effort::kToAnswer));
  if (!misfit_) {
    ASSIGN_OR_RETURN(misfit_, MisfitOfBase(before_, scout_rows_, batches_));
  }
  ASSIGN_OR_RETURN(Answer answer,
                   AnswerOfDesign(before_, *known, *asked, *misfit_, verification, level_));
  for (std::size_t i = borrowed_; i < n; ++i)
    answer.runs[campaign::ToString(batches_[i].stage)] += static_cast<int>(batches_[i].runs.size());
  answer.borrowed_runs = RunsIn(0, borrowed_);
  for (const auto& [c, change] : ChangesByNumerics(before_.base, scout_rows_, batches_)) {
    const NumericalChoice& choice = race().numerics[static_cast<std::size_t>(c)];
    answer.numerics.push_back({.name = choice.name,
                               .null = choice.null,
                               .tried = choice.tried,
                               .rms = RmsOf(before_.base, change.transpose())});
  }
  return answer;
}

absl::StatusOr<NextStep> DesignChain::Ended(std::size_t n,
                                            const VerificationChances& verification) {
  ASSIGN_OR_RETURN(Answer answer, AnswerAfter(n, verification));
  verification_ = verification;
  return answer;
}

absl::StatusOr<AnsweredDesign> DesignChain::Answered() {
  if (!verification_) return absl::FailedPreconditionError("the design has no answer yet");
  AnsweredDesign answered{.before = &before_,
                          .batches = &batches_,
                          .design = &design_,
                          .misfit = *misfit_,
                          .verification = *verification_,
                          .level = level_};
  ASSIGN_OR_RETURN(answered.known, KnownAfter(batches_.size()));
  ASSIGN_OR_RETURN(answered.asked, AskedAfter(batches_.size(), Effort::kToAnswer));
  return answered;
}

absl::StatusOr<NextStep> DesignChain::EndedElsewhere() {
  const std::size_t n = batches_.size();
  if (n == 0) return Ended(n, std::nullopt);
  // No run can be made to verify a name: each that is there has to be foreseen by the others.
  ASSIGN_OR_RETURN(const Knowledge* known, KnownAfter(n));
  const bool holds = LeftOutHolds(known->set->emulator());
  std::map<std::string, double> chances;
  for (const int k : known->part.kept) {
    const RacingEffect& entry = race().effects[static_cast<std::size_t>(k)];
    chances[entry.name] = holds || entry.design.calculated ? 1 : 0;
  }
  ASSIGN_OR_RETURN(NextStep step, Ended(n, std::move(chances)));
  if (!holds) {
    std::get<Answer>(step).warnings.push_back(
        "the runs with effects are not foreseen by each other as well as is said: more of them, at "
        "more strengths, would name what these cannot");
  }
  return step;
}

absl::StatusOr<NextStep> DesignChain::Next() {
  if (before_.base.elsewhere) return EndedElsewhere();
  const std::optional<SamplePurpose> last = LastStage();
  if (!last) return Scout();
  if (last == SamplePurpose::kScout) {
    if (batches_.size() == 1) {
      if (std::optional<RunBatch> again = ScoutAgain()) return *std::move(again);
    }
    ASSIGN_OR_RETURN(RunBatch main, Main());
    return main;
  }
  const std::size_t n = batches_.size();
  if (last != SamplePurpose::kVerification) {
    ASSIGN_OR_RETURN(std::optional<RunBatch> next, Sequential(n));
    if (!next) {
      ASSIGN_OR_RETURN(next, Verification());
    }
    if (next) return *std::move(next);
    return Ended(n, std::nullopt);
  }
  ASSIGN_OR_RETURN(const std::vector<VerifiedModel> models, ToVerify(n - 1));
  ASSIGN_OR_RETURN(const Knowledge* known, KnownAfter(n - 1));
  return Ended(
      n, ChancesOf(before_.base, *known, models, batches_.back(), kDesignCaps.verification_runs));
}

absl::StatusOr<Answer> AnswerBy(DesignChain& chain, RunMaker& maker,
                                std::optional<std::int64_t> most_runs) {
  ASSIGN_OR_RETURN(std::vector<EndedBatch> made, maker.Batches());
  for (EndedBatch& batch : made) RETURN_IF_ERROR(chain.Add(std::move(batch)));
  for (;;) {
    absl::StatusOr<NextStep> next = chain.Next();
    RETURN_IF_ERROR(next.status());
    if (auto* answer = std::get_if<Answer>(&*next)) return std::move(*answer);
    const RunBatch& batch = std::get<RunBatch>(*next);
    const std::int64_t runs = std::ssize(batch.rows) + chain.own_runs();
    if (most_runs && runs > *most_runs) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the runs that tell effects apart are ", runs, " with those of the stage ",
                       campaign::ToString(batch.stage),
                       ", each one parameter set through all fitted tests, and ", *most_runs,
                       " are allowed (what an earlier diagnosis has run counts too)"));
    }
    ASSIGN_OR_RETURN(EndedBatch ended, maker.Make(batch));
    RETURN_IF_ERROR(chain.Add(std::move(ended)));
  }
}

absl::StatusOr<Answer> AdequacyOf(const report::CampaignView& base, double level) {
  ASSIGN_OR_RETURN(BaseRuns runs, BaseRunsOf(base));
  inference::JointPrior prior = campaign::Priors(base.campaign);
  ASSIGN_OR_RETURN(BaseRegion region, RegionOf(runs, prior));
  Race nobody;
  for (const campaign::CalibratedParameter& parameter : base.campaign.parameters)
    nobody.base.push_back(parameter.name);
  const DesignRows rows(region.axes, std::move(nobody), Eigen::VectorXd(0));
  const KnownBefore before{.base = std::move(runs),
                           .region = std::move(region),
                           .prior = std::move(prior),
                           .seed = base.campaign.seed};
  ASSIGN_OR_RETURN(const BaseMisfit misfit, MisfitOfBase(before, rows, {}));
  Answer answer{.verdict = misfit.chance >= level ? AnswerVerdict::kAdequate
                                                  : AnswerVerdict::kUnexplained};
  TellMisfit(misfit, answer);
  answer.sentence = VerdictInWords(answer);
  return answer;
}

}  // namespace calib::diagnosis
