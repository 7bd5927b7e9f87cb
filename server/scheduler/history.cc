#include "server/scheduler/history.h"

#include <limits>
#include <map>
#include <set>

#include "server/scheduler/posterior_record.h"

namespace calib::scheduler {
namespace {

/// The keys of the evaluations that ended with all their states.
std::set<store::EvaluationKey> Finished(const std::vector<store::EvaluationRecord>& evaluations) {
  std::set<store::EvaluationKey> keys;
  for (const store::EvaluationRecord& evaluation : evaluations) {
    if (evaluation.status == store::EvaluationStatus::kFinished) {
      keys.insert(evaluation.key);
    }
  }
  return keys;
}

/// Rows of parameters, predictions still unknown, one matrix per iteration.
void AddSamples(const Definition& definition, History& history) {
  const auto d = static_cast<Eigen::Index>(definition.priors.size());
  const auto t = static_cast<Eigen::Index>(definition.data.readings.size());
  std::vector<Eigen::Index> count(history.iterations.size(), 0);
  for (const store::SampleRecord& sample : history.samples) {
    ++count[static_cast<std::size_t>(sample.iteration)];
  }
  std::vector<Eigen::Index> next(history.iterations.size(), 0);
  for (std::size_t k = 0; k < history.iterations.size(); ++k) {
    history.iterations[k].parameters.resize(count[k], d);
    history.iterations[k].predictions.setConstant(count[k], t,
                                                  std::numeric_limits<double>::quiet_NaN());
  }
  for (const store::SampleRecord& sample : history.samples) {
    const auto k = static_cast<std::size_t>(sample.iteration);
    history.iterations[k].parameters.row(next[k]++) = Eigen::Map<const Eigen::RowVectorXd>(
        sample.parameters.data(), static_cast<Eigen::Index>(sample.parameters.size()));
  }
}

}  // namespace

absl::StatusOr<History> LoadHistory(const Definition& definition, std::int64_t campaign,
                                    store::Reader& reader) {
  History history;
  auto iterations = reader.Iterations(campaign);
  auto samples = reader.Samples(campaign);
  auto evaluations = reader.Evaluations(campaign);
  auto states = reader.States(campaign);
  auto effort = reader.EffortOf(campaign);
  for (const absl::Status& status : {iterations.status(), samples.status(), evaluations.status(),
                                     states.status(), effort.status()}) {
    if (!status.ok()) {
      return status;
    }
  }
  for (store::IterationRecord& record : *iterations) {
    auto proposal = ProposalFromJson(record.proposal);
    if (!proposal.ok()) {
      return proposal.status();
    }
    inference::Iteration& iteration = history.iterations.emplace_back();
    iteration.proposal = *std::move(proposal);
    if (definition.campaign.precomputed.has_value()) {
      iteration.log_proposal = definition.campaign.precomputed->log_proposal;
    }
    if (record.posterior.has_value()) {
      history.last_posterior = std::move(record.posterior);
    }
  }
  history.samples = *std::move(samples);
  history.effort = *effort;
  AddSamples(definition, history);

  // Position of a sample within its iteration, by its number.
  std::map<int, std::pair<std::size_t, Eigen::Index>> place;
  std::vector<Eigen::Index> next(history.iterations.size(), 0);
  for (const store::SampleRecord& sample : history.samples) {
    const auto k = static_cast<std::size_t>(sample.iteration);
    place[sample.sample] = {k, next[k]++};
  }
  const auto finished = Finished(*evaluations);
  for (const store::StateRecord& state : *states) {
    if (finished.count(state.key) > 0) {
      const auto [k, row] = place.at(state.key.sample);
      Eigen::RowVectorXd predictions = history.iterations[k].predictions.row(row);
      definition.readings.Place(state.key.experiment, state.load_step, state.observables,
                                predictions);
      history.iterations[k].predictions.row(row) = predictions;
    }
  }
  for (const inference::Iteration& iteration : history.iterations) {
    std::vector<char>& diverged = history.diverged.emplace_back();
    for (Eigen::Index i = 0; i < iteration.predictions.rows(); ++i) {
      diverged.push_back(iteration.predictions.row(i).allFinite() ? 0 : 1);
    }
  }
  std::set<int> stopped;
  for (const store::EvaluationRecord& evaluation : *evaluations) {
    if (evaluation.status == store::EvaluationStatus::kStoppedEarly) {
      stopped.insert(evaluation.key.sample);
    }
  }
  history.stopped_early = static_cast<int>(stopped.size());
  return history;
}

}  // namespace calib::scheduler
