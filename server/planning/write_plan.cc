// A plan into the store.
#include "server/planning/plan.h"
#include "server/planning/posterior_record.h"

namespace calib::planning {

void Write(const Plan& plan, std::int64_t campaign, const store::CampaignProgress& progress,
           std::int64_t unix_ms, store::Transaction& transaction) {
  if (plan.conclusion.has_value()) {
    const Conclusion& conclusion = *plan.conclusion;
    transaction.SetPosterior(campaign, conclusion.iteration, PosteriorToJson(conclusion.posterior));
    for (std::size_t i = 0; i < conclusion.log_weights.size(); ++i) {
      transaction.SetWeight(campaign, conclusion.samples[i], conclusion.log_weights[i],
                            conclusion.log_likelihoods[i]);
    }
  }
  for (const std::optional<Start>& start : {plan.start, plan.draws}) {
    if (start.has_value()) {
      if (start->continues) {
        transaction.SetProposal(campaign, start->iteration, start->proposal);
      } else {
        transaction.InsertIteration(campaign, start->iteration, start->proposal);
      }
      for (const store::SampleRecord& sample : start->samples) {
        transaction.InsertSample(campaign, sample);
      }
    }
  }
  for (const store::EvaluationRecord& evaluation : plan.evaluations) {
    transaction.InsertEvaluation(evaluation);
  }
  for (const auto& [from, to] : plan.reused) {
    transaction.ReuseEvaluation(from, to);
  }
  for (const Plan::Resumed& resumed : plan.resumed) {
    transaction.NeverStop(campaign, resumed.key.sample);
    transaction.SetEvaluation(resumed.key, store::EvaluationStatus::kWaiting, "", 0);
    transaction.SetRest(resumed.key, resumed.rest_after);
  }
  for (const auto& [sample, share] : plan.audited) {
    transaction.Audit(campaign, sample, share);
  }
  for (const auto& [sample, stop_below] : plan.stop_below) {
    transaction.SetStopBelow(campaign, sample, stop_below);
  }
  for (const store::StateRecord& state : plan.states) {
    transaction.PutState(state, unix_ms);
  }
  transaction.SetProgress(campaign, progress);
  for (const std::string& line : plan.log) {
    transaction.Log(campaign, unix_ms, line);
  }
}

}  // namespace calib::planning
