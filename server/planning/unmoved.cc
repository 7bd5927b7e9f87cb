#include "server/planning/unmoved.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/campaign/checks/run_table_check.h"

namespace calib::planning {
namespace {

/// Probability of the prior within which a quantile counts as its own [-], and as much again for
/// chance. Chosen: a posterior narrower by a tenth to a sixth is told from its prior.
constexpr double kSameQuantile = 0.02;

double StandardNormalCdf(double score) { return 0.5 * std::erfc(-score / std::sqrt(2.0)); }

struct ReadingSpan {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
};

}  // namespace

std::vector<std::string> UnmovedReadings(const Definition& definition,
                                         std::span<const inference::Iteration> iterations) {
  std::vector<ReadingSpan> spans(definition.data.readings.size());
  int runs = 0;
  for (const inference::Iteration& iteration : iterations) {
    for (Eigen::Index i = 0; i < iteration.predictions.rows(); ++i) {
      if (!iteration.predictions.row(i).allFinite()) continue;
      ++runs;
      for (std::size_t k = 0; k < spans.size(); ++k) {
        const double value = iteration.predictions(i, static_cast<Eigen::Index>(k));
        spans[k] = {std::min(spans[k].low, value), std::max(spans[k].high, value)};
      }
    }
  }
  std::map<std::pair<int, int>, bool> moved;  // (experiment, observable)
  for (std::size_t k = 0; k < spans.size(); ++k) {
    const inference::Reading& reading = definition.data.readings[k];
    bool& any = moved[{reading.experiment, reading.observable}];
    any = any || campaign::IsMoved(spans[k].low, spans[k].high, reading.sd);
  }
  std::vector<std::string> sentences;
  for (const auto& [place, any] : moved) {
    if (any || runs < 2) continue;
    const campaign::Experiment& experiment =
        definition.campaign.experiments[static_cast<std::size_t>(place.first)];
    sentences.push_back(campaign::Sentence(campaign::UnmovedWarning(
        experiment, experiment.observables[static_cast<std::size_t>(place.second)], runs)));
  }
  return sentences;
}

std::string UnmovedParameters(const Definition& definition, const Answer& answer) {
  const inference::JointPrior& priors = definition.priors;
  if (!answer.HasIntervals() || !priors.is_independent() || priors.is_constrained()) return "";
  const double samples = answer.FromEmulator() ? static_cast<double>(answer.emulated->draws.rows())
                                               : answer.weighted.ess;
  const std::vector<inference::ParameterSummary> summaries = answer.Parameters();
  std::vector<std::string> names;
  for (std::size_t i = 0; i < summaries.size(); ++i) {
    if (definition.campaign.parameters[i].of_population) continue;  // unfitted labels have scores
    const auto same = [&](double quantile, double share) {
      const double by_chance = 2 * std::sqrt(share * (1 - share) / samples);
      return std::abs(StandardNormalCdf(priors[i].NormalScore(quantile)) - share) <=
             kSameQuantile + std::min(kSameQuantile, by_chance);
    };
    const inference::ParameterSummary& summary = summaries[i];
    if (same(summary.q05, 0.05) && same(summary.q50, 0.5) && same(summary.q95, 0.95)) {
      names.push_back(definition.campaign.parameters[i].name);
    }
  }
  if (names.empty()) return "";
  if (names.size() == summaries.size()) {
    return "The posterior is the prior: the readings say nothing of any parameter.";
  }
  return absl::StrCat("The posterior of ", absl::StrJoin(names, ", "),
                      names.size() == 1 ? " is its prior" : " is their prior",
                      ": the readings say nothing of ", names.size() == 1 ? "it." : "them.");
}

}  // namespace calib::planning
