#include "server/diagnosis/design_run.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/derive.h"
#include "server/methods/registry.h"

namespace calib::diagnosis {
namespace {

constexpr char kWhat[] = "runs that tell effects apart";

// Of a campaign whose runs were made elsewhere: no batch of its chain is asked for.
class NoRuns : public RunMaker {
 public:
  absl::StatusOr<std::vector<EndedBatch>> Batches() override { return std::vector<EndedBatch>(); }
  absl::StatusOr<EndedBatch> Make(const RunBatch& batch) override {
    return absl::FailedPreconditionError(
        absl::StrCat("runs of the stage ", campaign::ToString(batch.stage),
                     " are asked for, and those of this campaign were made elsewhere"));
  }
};

}  // namespace

absl::StatusOr<DesignedAnswer> AnswerOnServer(client::Laboratory& laboratory,
                                              const report::CampaignView& base,
                                              DesignQuestion question, const std::string& other,
                                              std::optional<std::int64_t> most_runs) {
  client::Laboratory::DesignWithBase others;
  if (!other.empty()) {
    if (base.campaign.precomputed) {
      return absl::FailedPreconditionError(
          "the runs of this campaign were made elsewhere: it has no use for those of a design");
    }
    ASSIGN_OR_RETURN(others, laboratory.DesignNamed(other));
    question.other = {.design = &others.design, .base = &others.base};
  }
  ASSIGN_OR_RETURN(DesignChain created, DesignChain::Create(base, question));
  const auto kept = std::make_shared<DesignChain>(std::move(created));
  DesignChain& chain = *kept;
  if (base.campaign.precomputed) {
    NoRuns none;
    DesignedAnswer calculated{.chain = kept};
    ASSIGN_OR_RETURN(calculated.answer, AnswerBy(chain, none, most_runs));
    return calculated;
  }
  campaign::Derivation derivation = DesignOf(base, chain.race());
  if (!other.empty()) derivation.name += absl::StrCat(", beside those of ", other);
  ASSIGN_OR_RETURN(const std::string text,
                   campaign::Derive(methods::All(), base.source.campaign_file(), derivation));
  ASSIGN_OR_RETURN(report::CampaignView design, laboratory.Design(base, text, kWhat));
  DesignedAnswer designed{
      .chain = kept, .campaign = design.status.campaign(), .parameters = derivation.parameters};
  ServerRunMaker maker(laboratory, std::move(design), chain.names(), kWhat);
  ASSIGN_OR_RETURN(designed.answer, AnswerBy(chain, maker, most_runs));
  return designed;
}

}  // namespace calib::diagnosis
