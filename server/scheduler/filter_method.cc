// sqmc and the iterative Bayesian filter: weighted samples of all iterations.

#include <utility>

#include "server/scheduler/early_stopping.h"
#include "server/scheduler/method.h"
#include "server/scheduler/posterior_record.h"

namespace calib::scheduler {
namespace {

class FilterMethod final : public Method {
 public:
  explicit FilterMethod(const Definition& definition)
      : definition_(definition), campaign_(definition.campaign) {}

  absl::StatusOr<Batch> First() const override {
    return Draw({}, campaign::FirstProposalOf(campaign_));
  }

  absl::StatusOr<Outcome> Conclude(const History& history, bool affordable) const override {
    auto answer = FindAnswer(definition_, history.iterations);
    if (!answer.ok()) {
      return answer.status();
    }
    const auto converged = IsConverged(*answer, history);
    if (!converged.ok()) {
      return converged.status();
    }
    Outcome outcome{.answer = *std::move(answer), .converged = *converged, .log = "", .next = {}};
    const auto iterations = static_cast<int>(history.iterations.size());
    if (outcome.converged || !affordable || iterations >= campaign::MostBatches(campaign_)) {
      return outcome;
    }
    const auto proposal = NextProposal(outcome.answer, history);
    if (!proposal.ok()) {
      return proposal.status();
    }
    auto next = Draw(history, *proposal);
    if (!next.ok()) {
      return next.status();
    }
    outcome.next = *std::move(next);
    return outcome;
  }

 private:
  // Where the weights hold a handful of samples, the emulator of their states knows better where
  // the posterior lies, even one that is not good enough for an interval yet.
  absl::StatusOr<inference::Proposal> NextProposal(const Answer& answer,
                                                   const History& history) const {
    if (answer.emulated.has_value() && answer.emulated->draws.rows() > 0) {
      return inference::FitProposalToDraws(definition_.priors, campaign_.filter,
                                           answer.emulated->draws, history.iterations.size());
    }
    return inference::FitProposal(definition_.priors, definition_.data, campaign_.filter,
                                  history.iterations);
  }

  absl::StatusOr<bool> IsConverged(const Answer& answer, const History& history) const {
    if (!answer.HasIntervals()) {
      return false;
    }
    if (campaign_.method == campaign::Method::kSqmc || campaign_.precomputed.has_value()) {
      return true;  // one iteration is all there is
    }
    if (!history.last_posterior.has_value()) {
      return false;
    }
    const auto before = PosteriorFromJson(*history.last_posterior);
    if (!before.ok()) {
      return before.status();
    }
    if (before->posterior_from() == "none") {
      return false;
    }
    inference::Posterior now;
    now.parameters = answer.Parameters();
    return inference::MeansConverged(MeansOf(*before), now, campaign_.filter);
  }

  absl::StatusOr<Batch> Draw(const History& history, const inference::Proposal& proposal) const {
    Batch batch{
        .proposal = ProposalToJson(proposal), .parameters = {}, .stop_below = {}, .refused = {}};
    if (campaign_.precomputed.has_value()) {
      batch.parameters = campaign_.precomputed->parameters;
    } else {
      auto drawn =
          inference::DrawSamples(proposal, definition_.priors, campaign_.filter,
                                 static_cast<int>(history.iterations.size()), campaign_.samples);
      if (!drawn.ok()) {
        return drawn.status();
      }
      batch.parameters = *std::move(drawn);
    }
    auto thresholds = StopThresholds(definition_, history,
                                     {.proposal = proposal,
                                      .parameters = batch.parameters,
                                      .predictions = {},
                                      .log_proposal = {}});
    if (!thresholds.ok()) {
      return thresholds.status();
    }
    batch.stop_below = *std::move(thresholds);
    return batch;
  }

  const Definition& definition_;
  const campaign::Campaign& campaign_;
};

}  // namespace

std::unique_ptr<Method> MakeFilterMethod(const Definition& definition) {
  return std::make_unique<FilterMethod>(definition);
}

}  // namespace calib::scheduler
