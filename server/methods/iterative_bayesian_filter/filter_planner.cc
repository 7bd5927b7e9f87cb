#include "server/methods/iterative_bayesian_filter/filter_planner.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "calib/return_if_error.h"
#include "server/planning/early_stopping.h"
#include "server/planning/posterior_record.h"

namespace calib::methods {
namespace {

class FilterPlanner final : public planning::Planner {
 public:
  FilterPlanner(const planning::Definition& definition, const FilterPlan& plan)
      : definition_(definition), campaign_(definition.campaign), plan_(plan) {}

  absl::StatusOr<planning::Batch> First() const override {
    ASSIGN_OR_RETURN(planning::Batch batch, Draw({}, campaign::FirstProposalOf(campaign_)));
    if (campaign_.table.has_value()) {
      const Eigen::MatrixXd& given = campaign_.table->parameters;
      Eigen::MatrixXd all(given.rows() + batch.parameters.rows(), given.cols());
      all << given, batch.parameters;
      batch.parameters = std::move(all);
      batch.stop_below.insert(batch.stop_below.begin(), static_cast<std::size_t>(given.rows()),
                              store::kUnknown);
    }
    return batch;
  }

  absl::StatusOr<planning::Outcome> Conclude(const planning::History& history,
                                             bool affordable) const override {
    ASSIGN_OR_RETURN(auto answer, planning::FindAnswer(definition_, history.iterations));
    ASSIGN_OR_RETURN(const auto converged, IsConverged(answer, history));
    planning::Outcome outcome{
        .answer = std::move(answer), .converged = converged, .log = "", .next = {}};
    const auto iterations = static_cast<int>(history.iterations.size());
    if (outcome.converged || !affordable ||
        iterations >= campaign_.method->MostBatches(campaign_)) {
      return outcome;
    }
    ASSIGN_OR_RETURN(const auto frozen, Hold(outcome.answer, history));
    ASSIGN_OR_RETURN(const auto proposal, NextProposal(outcome.answer, history, frozen));
    ASSIGN_OR_RETURN(auto next, Draw(history, proposal));
    outcome.next = std::move(next);
    return outcome;
  }

  absl::StatusOr<std::vector<std::pair<int, double>>> Thresholds(
      const planning::History& history) const override {
    return planning::ThresholdsNow(definition_, history);
  }

 private:
  // Where the weights hold a handful of samples, the emulator of their states knows better where
  // the posterior lies, even one that is not good enough for an interval yet.
  absl::StatusOr<inference::Proposal> NextProposal(
      const planning::Answer& answer, const planning::History& history,
      const std::vector<std::optional<double>>& frozen) const {
    if (answer.emulated.has_value()) {
      const planning::SearchDraws from =
          planning::DrawsToGoOnFrom(definition_, history.iterations, answer);
      if (from.draws.rows() > 0) {
        return inference::FitProposalToDraws(definition_.priors, campaign_.filter, from.draws,
                                             history.iterations.size(), frozen, from.closest);
      }
    }
    return inference::FitProposal(definition_.priors, definition_.data, campaign_.filter,
                                  history.iterations, frozen);
  }

  absl::StatusOr<bool> IsConverged(const planning::Answer& answer,
                                   const planning::History& history) const {
    if (!answer.HasIntervals()) {
      return false;
    }
    if (plan_.once || campaign_.precomputed.has_value()) {
      return true;  // one iteration is all there is
    }
    if (!history.last_posterior.has_value()) {
      return false;
    }
    ASSIGN_OR_RETURN(const auto before, planning::PosteriorFromJson(*history.last_posterior));
    if (before.posterior_from() == "none") {
      return false;
    }
    inference::Posterior now;
    now.parameters = answer.Parameters();
    return inference::MeansConverged(planning::MeansOf(before), now, campaign_.filter);
  }

  /// What the next iteration holds: what this one held, and what `freeze` says of the next, at the
  /// mean so far. At least one parameter stays free.
  absl::StatusOr<std::vector<std::optional<double>>> Hold(const planning::Answer& answer,
                                                          const planning::History& history) const {
    std::vector<std::optional<double>> frozen = history.iterations.back().proposal.frozen;
    const auto rule = plan_.freeze.find(static_cast<int>(history.iterations.size()));
    if (rule == plan_.freeze.end()) {
      return frozen;
    }
    const std::vector<inference::ParameterSummary> now = answer.Parameters();
    std::vector<char> still(now.size(), 0);
    if (rule->second.converged && answer.HasIntervals() && history.last_posterior.has_value()) {
      ASSIGN_OR_RETURN(const auto before, planning::PosteriorFromJson(*history.last_posterior));
      inference::Posterior posterior;
      posterior.parameters = now;
      still = inference::ConvergedMeans(planning::MeansOf(before), posterior, campaign_.filter);
    }
    frozen.resize(now.size());
    auto free = std::count(frozen.begin(), frozen.end(), std::nullopt);
    for (std::size_t j = 0; j < now.size() && free > 1; ++j) {
      const auto& names = rule->second.names;
      const bool named =
          std::find(names.begin(), names.end(), campaign_.parameters[j].name) != names.end();
      if (!frozen[j].has_value() && (named || still[j] != 0)) {
        frozen[j] = now[j].mean;
        --free;
      }
    }
    return free < static_cast<std::ptrdiff_t>(now.size()) ? frozen
                                                          : std::vector<std::optional<double>>{};
  }

  absl::StatusOr<planning::Batch> Draw(const planning::History& history,
                                       const inference::Proposal& proposal) const {
    planning::Batch batch{.proposal = planning::ProposalToJson(proposal),
                          .parameters = {},
                          .stop_below = {},
                          .refused = {}};
    if (campaign_.precomputed.has_value()) {
      batch.parameters = campaign_.precomputed->parameters;
    } else {
      ASSIGN_OR_RETURN(
          auto drawn,
          inference::DrawSamples(proposal, definition_.priors, campaign_.filter,
                                 static_cast<int>(history.iterations.size()), campaign_.samples));
      batch.parameters = std::move(drawn);
    }
    ASSIGN_OR_RETURN(auto thresholds, planning::StopThresholds(definition_, history,
                                                               {.proposal = proposal,
                                                                .parameters = batch.parameters,
                                                                .predictions = {},
                                                                .log_proposal = {}}));
    batch.stop_below = std::move(thresholds);
    return batch;
  }

  const planning::Definition& definition_;
  const campaign::Campaign& campaign_;
  const FilterPlan& plan_;
};

}  // namespace

std::unique_ptr<planning::Planner> MakeFilterPlanner(const planning::Definition& definition,
                                                     const FilterPlan& plan) {
  return std::make_unique<FilterPlanner>(definition, plan);
}

}  // namespace calib::methods
