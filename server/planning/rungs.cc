#include "server/planning/rungs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "server/planning/early_stopping.h"

namespace calib::planning {
namespace {

/// Where a share of the load steps ends, without the last one: that is the end.
std::vector<int> RungsOf(const Definition& definition, int experiment) {
  std::vector<int> rungs;
  if (!RestsAtRungs(definition)) {
    return rungs;
  }
  const auto steps = definition.LoadSteps(experiment);
  for (const double share : definition.campaign.early_stopping->rungs) {
    const auto count =
        static_cast<std::size_t>(std::ceil(share * static_cast<double>(steps.size())));
    if (count < steps.size() && (rungs.empty() || rungs.back() != steps[count - 1])) {
      rungs.push_back(steps[count - 1]);
    }
  }
  return rungs;
}

/// So many finished samples per effective one.

}  // namespace

bool RestsAtRungs(const Definition& definition) {
  return StopsEarly(definition) && definition.campaign.method->weighs_samples() &&
         !definition.campaign.early_stopping->rungs.empty();
}

std::optional<int> FirstRung(const Definition& definition, int experiment) {
  const auto rungs = RungsOf(definition, experiment);
  return rungs.empty() ? std::nullopt : std::optional<int>(rungs.front());
}

std::optional<int> NextRung(const Definition& definition, const History& history,
                            const store::EvaluationKey& key) {
  const auto resting = history.resting.find(key);
  if (resting == history.resting.end()) {
    return std::nullopt;
  }
  const auto rungs = RungsOf(definition, key.experiment);
  const auto here = std::find(rungs.begin(), rungs.end(), resting->second);
  return here == rungs.end() || here + 1 == rungs.end() ? std::nullopt
                                                        : std::optional<int>(*(here + 1));
}

std::vector<store::EvaluationKey> Scouts(const Definition& definition, const History& history) {
  if (!RestsAtRungs(definition) || history.resting.empty()) {
    return {};
  }
  std::map<int, std::vector<store::EvaluationKey>> resting;  // by sample
  for (const auto& [key, load_step] : history.resting) {
    resting[key.sample].push_back(key);
  }
  double finished = 0;
  for (const std::vector<char>& diverged : history.diverged) {
    finished += static_cast<double>(std::count(diverged.begin(), diverged.end(), 0));
  }
  const double wanted = FinishedWanted(definition);
  if (finished >= wanted) {
    return {};
  }
  const Eigen::VectorXd importance =
      inference::LogImportance(definition.priors, history.iterations);
  std::vector<std::pair<double, int>> ranked;  // (-ln of what it can still weigh, sample)
  std::size_t at = 0;
  for (const Eigen::MatrixXd& stopped : history.stopped) {
    const auto bound =
        inference::LogLikelihoodBound(definition.data, definition.campaign.filter, stopped);
    for (Eigen::Index i = 0; i < stopped.rows(); ++i, ++at) {
      const int sample = history.samples[at].sample;
      if (resting.count(sample) > 0) {
        const double best = bound.ok() ? (*bound)(i) : 0;
        ranked.emplace_back(-(importance(static_cast<Eigen::Index>(at)) + best), sample);
      }
    }
  }
  std::sort(ranked.begin(), ranked.end());
  std::vector<store::EvaluationKey> scouts;
  for (const auto& [cost, sample] : ranked) {
    if (finished >= wanted) {
      break;
    }
    const auto& of_sample = resting[sample];
    scouts.insert(scouts.end(), of_sample.begin(), of_sample.end());
    ++finished;
  }
  std::sort(scouts.begin(), scouts.end());
  return scouts;
}

}  // namespace calib::planning
