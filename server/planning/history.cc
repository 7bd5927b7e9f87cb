#include "server/planning/history.h"

#include <limits>
#include <map>
#include <set>

#include "calib/return_if_error.h"
#include "server/planning/plan_memory.h"
#include "server/planning/posterior_record.h"

namespace calib::planning {
namespace {

std::set<store::EvaluationKey> WithStatus(const std::vector<store::EvaluationRecord>& evaluations,
                                          store::EvaluationStatus status) {
  std::set<store::EvaluationKey> keys;
  for (const store::EvaluationRecord& evaluation : evaluations) {
    if (evaluation.status == status) {
      keys.insert(evaluation.key);
    }
  }
  return keys;
}

void PlaceState(const Definition& definition, const store::StateRecord& state, Eigen::Index row,
                Eigen::MatrixXd& predictions) {
  definition.readings.Place(state.key.experiment, state.load_step, state.observables,
                            predictions.row(row));
}

/// Whether its ended iterations are kept from plan to plan: nothing of them is ever run again.
bool IsKept(const Definition& definition) { return definition.campaign.method->keeps_batches(); }

/// Rows of parameters, predictions still unknown, one matrix per iteration from `known` on.
void AddSamples(const Definition& definition, std::size_t known, History& history) {
  const auto d = static_cast<Eigen::Index>(definition.priors.size());
  const auto t = static_cast<Eigen::Index>(definition.data.readings.size());
  std::vector<Eigen::Index> count(history.iterations.size(), 0);
  for (const store::SampleRecord& sample : history.samples) {
    ++count[static_cast<std::size_t>(sample.iteration)];
  }
  std::vector<Eigen::Index> next(history.iterations.size(), 0);
  for (std::size_t k = known; k < history.iterations.size(); ++k) {
    history.iterations[k].parameters.resize(count[k], d);
    history.iterations[k].predictions.setConstant(count[k], t,
                                                  std::numeric_limits<double>::quiet_NaN());
    history.stopped.push_back(history.iterations[k].predictions);
  }
  for (const store::SampleRecord& sample : history.samples) {
    const auto k = static_cast<std::size_t>(sample.iteration);
    if (k < known) {
      continue;
    }
    history.iterations[k].parameters.row(next[k]++) = Eigen::Map<const Eigen::RowVectorXd>(
        sample.parameters.data(), static_cast<Eigen::Index>(sample.parameters.size()));
  }
}

using Places = std::map<int, std::pair<std::size_t, Eigen::Index>>;  // by sample

/// What has ended and what is open, of all evaluations or those of the samples that have a place
/// alone. What was stopped before it had a state was never run.
void AddEnds(const std::vector<store::EvaluationRecord>& evaluations, const Places& place,
             bool placed_alone, History& history) {
  for (std::size_t k = history.ended.size(); k < history.iterations.size(); ++k) {
    history.ended.emplace_back(static_cast<std::size_t>(history.iterations[k].parameters.rows()),
                               1);
  }
  history.open = 0;
  std::int64_t ran = 0;  // to an end here
  for (const store::EvaluationRecord& evaluation : evaluations) {
    const auto found = place.find(evaluation.key.sample);
    if (placed_alone && found == place.end()) {
      continue;
    }
    if (campaign::IsTerminal(evaluation.status)) {
      const bool spared = evaluation.status == store::EvaluationStatus::kStoppedEarly &&
                          history.begun.count(evaluation.key) == 0;
      ran += evaluation.reused || spared ? 0 : 1;
      continue;
    }
    ++history.open;
    if (found != place.end()) {
      const auto [k, row] = found->second;
      history.ended[k][static_cast<std::size_t>(row)] = 0;
    }
  }
  history.effort.model_evaluations = ran;
}

// Given runs stand for no density: +infinity. The samples beside them keep their own.
void MarkGiven(const Definition& definition, History& history) {
  const Eigen::Index given = GivenRuns(definition.campaign);
  if (given == 0 || !definition.campaign.method->weighs_samples() || history.iterations.empty())
    return;
  inference::Iteration& iteration = history.iterations.front();
  iteration.log_proposal =
      inference::LogDensity(iteration.proposal, definition.priors, iteration.parameters);
  iteration.log_proposal->head(given).setConstant(std::numeric_limits<double>::infinity());
}

}  // namespace

Eigen::Index GivenRuns(const campaign::Campaign& campaign) {
  return campaign.table.has_value() && !campaign::RunsRowsOnly(campaign)
             ? campaign.table->parameters.rows()
             : Eigen::Index{0};
}

int LargestIteration(const campaign::Campaign& campaign) {
  return campaign.samples + static_cast<int>(GivenRuns(campaign));
}

absl::StatusOr<History> LoadHistory(const Definition& definition, std::int64_t campaign,
                                    store::Reader& reader, std::optional<int> first_iterations) {
  const bool keeps = IsKept(definition) && !first_iterations.has_value();
  History history =
      keeps && definition.memory->history.has_value() ? *definition.memory->history : History{};
  const std::size_t known = history.iterations.size();
  const int first = history.samples.empty() ? 0 : history.samples.back().sample + 1;
  ASSIGN_OR_RETURN(auto iterations, reader.Iterations(campaign));
  ASSIGN_OR_RETURN(auto samples, reader.Samples(campaign, first));
  ASSIGN_OR_RETURN(auto evaluations, reader.Evaluations(campaign));
  ASSIGN_OR_RETURN(auto states, reader.StatesFrom(campaign, first));
  ASSIGN_OR_RETURN(auto effort, reader.EffortOf(campaign));
  history.last_posterior.reset();
  history.previous_posterior.reset();
  history.concluded = 0;
  for (store::IterationRecord& record : iterations) {
    if (record.proposal == kHeldOutDraws || record.proposal == kReplicates) {
      break;  // nothing of the ensemble comes after them
    }
    if (first_iterations.has_value() && record.number >= *first_iterations) {
      break;
    }
    if (static_cast<std::size_t>(record.number) >= known) {
      inference::Iteration& iteration = history.iterations.emplace_back();
      if (definition.campaign.method->weighs_samples()) {
        ASSIGN_OR_RETURN(auto proposal, ProposalFromJson(record.proposal));
        iteration.proposal = std::move(proposal);
      }
      history.proposals.push_back(std::move(record.proposal));
      if (definition.campaign.precomputed.has_value()) {
        iteration.log_proposal = definition.campaign.precomputed->log_proposal;
      }
    }
    if (record.posterior.has_value()) {
      history.previous_posterior = std::move(history.last_posterior);
      history.last_posterior = std::move(record.posterior);
      ++history.concluded;
    }
  }
  std::erase_if(samples, [&history](const store::SampleRecord& sample) {
    return static_cast<std::size_t>(sample.iteration) >= history.iterations.size();
  });
  history.samples.insert(history.samples.end(), samples.begin(), samples.end());
  history.effort = effort;
  AddSamples(definition, known, history);
  MarkGiven(definition, history);

  // Position of a sample within its iteration, by its number.
  Places place;
  std::vector<Eigen::Index> next(history.iterations.size(), 0);
  for (const store::SampleRecord& sample : samples) {
    const auto k = static_cast<std::size_t>(sample.iteration);
    place[sample.sample] = {k, next[k]++};
  }
  const auto finished = WithStatus(evaluations, store::EvaluationStatus::kFinished);
  auto stopped = WithStatus(evaluations, store::EvaluationStatus::kStoppedEarly);
  for (const store::StateRecord& state : states) {
    if (stopped.count(state.key) > 0) {
      history.begun.insert(state.key);
    }
  }
  AddEnds(evaluations, place, first_iterations.has_value(), history);
  std::set<int> without_weight;  // whatever their other experiments would come to
  for (const auto& key : WithStatus(evaluations, store::EvaluationStatus::kDiverged)) {
    without_weight.insert(key.sample);
  }
  for (const auto& key : WithStatus(evaluations, store::EvaluationStatus::kUnknown)) {
    without_weight.insert(key.sample);
  }
  std::erase_if(stopped, [&without_weight](const store::EvaluationKey& key) {
    return without_weight.count(key.sample) > 0;
  });
  for (const auto& key : WithStatus(evaluations, store::EvaluationStatus::kUnknown)) {
    const auto found = place.find(key.sample);
    if (found == place.end()) continue;  // kept from before, or of an iteration left out
    history.unknown.insert(key.sample);
    const auto [k, row] = found->second;
    std::vector<char>& aside = history.iterations[k].aside;
    aside.resize(static_cast<std::size_t>(history.iterations[k].parameters.rows()), 0);
    aside[static_cast<std::size_t>(row)] = 1;
  }
  std::set<int> stopped_samples;
  std::set<int> begun;  // of those: the others were rejected without a run
  for (const store::EvaluationKey& key : stopped) {
    stopped_samples.insert(key.sample);
  }
  for (const store::StateRecord& state : states) {
    const auto found = place.find(state.key.sample);
    if (found == place.end()) {
      continue;
    }
    const auto [k, row] = found->second;
    if (finished.count(state.key) > 0) {
      PlaceState(definition, state, row, history.iterations[k].predictions);
    }
    if (history.unknown.count(state.key.sample) > 0) {
      PlaceState(definition, state, row, history.stopped[k]);
    }
    if (stopped_samples.count(state.key.sample) > 0) {
      PlaceState(definition, state, row, history.stopped[k]);
      begun.insert(state.key.sample);
    }
  }
  history.stopped_keys = {stopped.begin(), stopped.end()};
  for (const store::EvaluationRecord& evaluation : evaluations) {
    if (stopped.count(evaluation.key) > 0 && evaluation.rest_after.has_value()) {
      history.resting[evaluation.key] = *evaluation.rest_after;
    }
  }
  history.stopped_early += static_cast<int>(begun.size());
  for (std::size_t k = known; k < history.iterations.size(); ++k) {
    std::vector<char>& diverged = history.diverged.emplace_back();
    const Eigen::MatrixXd& predictions = history.iterations[k].predictions;
    for (Eigen::Index i = 0; i < predictions.rows(); ++i) {
      diverged.push_back(predictions.row(i).allFinite() ? 0 : 1);
    }
  }
  for (std::size_t k = known; k < history.iterations.size(); ++k) {
    history.iterations[k].stopped = history.stopped[k];  // for the emulator
  }
  if (keeps && history.open == 0) {
    definition.memory->history = history;
  }
  return history;
}

}  // namespace calib::planning
