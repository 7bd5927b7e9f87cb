#include "server/campaign/model/population.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

std::string SpreadName(const std::string& name) { return absl::StrCat(name, ".spread"); }
std::string MemberName(const std::string& name, const std::string& label) {
  return absl::StrCat(name, "@", label);
}
std::string ScoreName(const std::string& name, const std::string& label) {
  return absl::StrCat(MemberName(name, label), kScoreSuffix);
}

bool IsScoreName(const std::string& name) {
  return absl::StrContains(name, '@') && absl::EndsWith(name, kScoreSuffix);
}

const std::string& LabelOf(Per per, const Experiment& experiment) {
  return per == Per::kExperiment ? experiment.name : experiment.batch;
}

std::vector<double> MembersOf(const Population& population, std::span<const double> values) {
  std::vector<double> members;
  members.reserve(population.scores.size());
  for (const std::size_t score : population.scores) {
    members.push_back(values[population.common] + values[population.spread] * values[score]);
  }
  return members;
}

std::vector<double> ValuesIn(const Campaign& campaign, const Experiment& experiment,
                             std::span<const double> values) {
  std::vector<double> own(values.begin(), values.end());
  for (const Population& population : campaign.populations) {
    const auto& labels = population.labels;
    const auto found = std::find(labels.begin(), labels.end(), LabelOf(population.per, experiment));
    if (found == labels.end()) continue;
    own[population.common] =
        MembersOf(population, values)[static_cast<std::size_t>(found - labels.begin())];
  }
  return own;
}

double DrawScore(const Population& population, double common, double spread,
                 inference::PhiloxStream& stream) {
  inference::Prior score{.kind = inference::PriorKind::kNormal, .mean = 0, .sd = 1};
  if (spread > 0) {
    score.min = (population.min - common) / spread;
    score.max = (population.max - common) / spread;
  }
  return score.Quantile(stream.Uniform());
}

std::vector<inference::MemberBounds> MemberBoundsOf(const Campaign& campaign) {
  std::vector<inference::MemberBounds> bounds;
  for (const Population& population : campaign.populations) {
    if (std::isinf(population.min) && std::isinf(population.max)) continue;
    for (const std::size_t score : population.scores) {
      bounds.push_back({.common = static_cast<Eigen::Index>(population.common),
                        .spread = static_cast<Eigen::Index>(population.spread),
                        .score = static_cast<Eigen::Index>(score),
                        .min = population.min,
                        .max = population.max});
    }
  }
  return bounds;
}

int FreeParameters(const Campaign& campaign) {
  const auto latent =
      std::count_if(campaign.parameters.begin(), campaign.parameters.end(),
                    [](const CalibratedParameter& one) { return one.of_population; });
  auto free = std::ssize(campaign.parameters) - latent;
  for (const Population& population : campaign.populations) {
    std::set<std::string> fitted;
    for (const Experiment& experiment : campaign.experiments) {
      if (experiment.role == Role::kCalibrate) fitted.insert(LabelOf(population.per, experiment));
    }
    free += std::max<std::ptrdiff_t>(std::ssize(fitted), 1) - 1;
  }
  return static_cast<int>(free);
}

}  // namespace calib::campaign
