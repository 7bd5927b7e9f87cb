#include "server/diagnosis/verification.h"

#include <algorithm>
#include <cstddef>
#include <set>

#include "inference/diagnosis/next_runs.h"

namespace calib::diagnosis {

using Eigen::Index;

std::vector<VerifiedModel> ModelsToVerify(const Knowledge& knowledge, const Asked& asked,
                                          const VerificationQuestion& question) {
  std::vector<VerifiedModel> models;
  const std::vector<inference::ModelEvidence>& evidence = asked.evidence[0];
  const std::set<std::string> named(question.named.begin(), question.named.end());
  std::vector<std::set<std::string>> taken;
  if (named.empty()) return models;
  for (const Index i : inference::LeadingModels(evidence, asked.probabilities[0], 0,
                                                static_cast<int>(evidence.size()))) {
    const inference::ModelEvidence& own = evidence[static_cast<std::size_t>(i)];
    const std::vector<std::string> names = EffectsNamed(knowledge, own.model);
    const std::set<std::string> each(names.begin(), names.end());
    if (names.empty() || std::find(taken.begin(), taken.end(), each) != taken.end()) continue;
    const bool has_all = std::includes(each.begin(), each.end(), named.begin(), named.end());
    if (models.empty() ? !has_all
                       : has_all || each.size() > models.front().effects.size() ||
                             asked.probabilities[0].model[i] < question.sibling)
      continue;
    taken.push_back(each);
    models.push_back({.effects = names, .optimum = BestDraw(knowledge, own.draws)});
    if (static_cast<int>(models.size()) == question.most) break;
  }
  return models;
}

std::map<std::string, double> ChancesOf(const BaseRuns& base, const Knowledge& knowledge,
                                        const std::vector<VerifiedModel>& models,
                                        const EndedBatch& runs, int each) {
  std::map<std::string, double> chances;
  std::size_t next = 0;
  for (const VerifiedModel& model : models) {
    std::vector<std::vector<double>> values;
    std::vector<int> packing;
    std::vector<Eigen::RowVectorXd> readings;
    for (int r = 0; r < each && next < runs.runs.size(); ++r, ++next) {
      const EndedRun& ended = runs.runs[next];
      if (!ended.readings) continue;
      values.push_back(ended.run.values);
      // One packing is chaos alone: each run is another specimen.
      packing.push_back(base.packings > 1 ? ended.run.stream % base.packings : r);
      readings.push_back(*ended.readings);
    }
    double chance = 0;
    if (!values.empty()) {
      Eigen::MatrixXd rows(static_cast<Index>(readings.size()), readings.front().size());
      for (std::size_t i = 0; i < readings.size(); ++i)
        rows.row(static_cast<Index>(i)) = readings[i];
      chance = inference::VerificationChance(
          *knowledge.set,
          PartOfPoints(knowledge.rows, knowledge.part, knowledge.rows.Points(values)), packing,
          base.scale.Scaled(rows));
    }
    for (const std::string& effect : model.effects) {
      const auto [place, fresh] = chances.try_emplace(effect, chance);
      if (!fresh) place->second = std::min(place->second, chance);
    }
  }
  return chances;
}

}  // namespace calib::diagnosis
