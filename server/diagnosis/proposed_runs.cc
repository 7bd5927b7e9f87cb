#include "server/diagnosis/proposed_runs.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/derive.h"
#include "server/diagnosis/design_caps.h"
#include "server/diagnosis/stage_rows.h"
#include "server/methods/registry.h"

namespace calib::diagnosis {

using campaign::SamplePurpose;

namespace {
constexpr char kWhatOfTest[] = "runs of the next experiment";
}  // namespace

absl::StatusOr<ProposedRuns> ProposedRuns::Open(client::Laboratory& laboratory,
                                                const report::CampaignView& base,
                                                const AnsweredDesign& answered,
                                                const LeadingModels& leading,
                                                const TestEntry& test) {
  campaign::Derivation derivation = DesignOf(base, answered.known->rows.race());
  derivation.name = absl::StrCat(base.campaign.name, ": next experiment");
  derivation.lineage.purpose = campaign::ToString(campaign::DerivedFor::kNextExperiment);
  derivation.experiments = {test.entry};
  ASSIGN_OR_RETURN(const std::string text,
                   campaign::Derive(methods::All(), base.source.campaign_file(), derivation));
  ASSIGN_OR_RETURN(report::CampaignView design,
                   laboratory.Design(base, text, kWhatOfTest, {{test.file, test.data}}));
  return ProposedRuns(
      answered, leading,
      ServerRunMaker(laboratory, std::move(design), answered.known->rows.names(), kWhatOfTest));
}

absl::StatusOr<KnownTest> ProposedRuns::Learn() {
  for (int number = 0;; ++number) {
    ASSIGN_OR_RETURN(const std::vector<EndedBatch> made, maker_.Batches());
    if (static_cast<int>(made.size()) <= number) {
      ASSIGN_OR_RETURN(const TestRuns test, RunsOfTest(maker_.design(), answered_->known->rows, 0));
      RunBatch batch{
          .number = number,
          .stage = number == 0 ? SamplePurpose::kMain : SamplePurpose::kSequential,
          .rows = RowsOfTest(*answered_, *leading_, test.base, static_cast<int>(runs()))};
      if (!batch.rows.empty()) {
        ASSIGN_OR_RETURN(const EndedBatch ended, maker_.Make(batch));
      }
    }
    ASSIGN_OR_RETURN(KnownTest known,
                     LearnTest(*answered_, *leading_, maker_.design(), number + 1));
    if (known.holds || number == 1) return known;
  }
}

absl::StatusOr<std::map<std::string, double>> ProposedRuns::Verify(
    const KnownTest& known, const std::vector<VerifiedModel>& models) {
  std::map<std::string, double> none;
  if (models.empty()) return none;
  ASSIGN_OR_RETURN(std::vector<EndedBatch> made, maker_.Batches());
  if (made.empty() || made.back().stage != SamplePurpose::kVerification) {
    const Knowledge& of_all = *answered_->known;
    const RunBatch batch{
        .number = static_cast<int>(made.size()),
        .stage = SamplePurpose::kVerification,
        .rows = AdmissibleRows(*answered_->design, of_all.rows, answered_->before->region,
                               WholePoints(of_all.rows, of_all.part, VerificationPoints(models)),
                               answered_->before->base.samples + static_cast<int>(runs()))};
    ASSIGN_OR_RETURN(EndedBatch ended, maker_.Make(batch));
    made.push_back(std::move(ended));
  }
  return ChancesOf(known.base, known.known, models, made.back(), kDesignCaps.verification_runs);
}

std::int64_t ProposedRuns::runs() const {
  std::int64_t runs = 0;
  for (const v1::Sample& sample : maker_.design().samples) runs += sample.iteration() >= 0 ? 1 : 0;
  return runs;
}

}  // namespace calib::diagnosis
