#include "server/diagnosis/verification.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>

#include "inference/diagnosis/next_runs.h"

namespace calib::diagnosis {

using Eigen::Index;

namespace {

using Names = std::set<std::string>;

// Whether a model is the other with one effect exchanged for another of its family.
bool IsExchanged(const Names& model, const Names& other,
                 const std::vector<std::vector<std::string>>& families) {
  std::vector<std::string> own, lost;
  std::set_difference(model.begin(), model.end(), other.begin(), other.end(),
                      std::back_inserter(own));
  std::set_difference(other.begin(), other.end(), model.begin(), model.end(),
                      std::back_inserter(lost));
  if (own.size() != 1 || lost.size() != 1) return false;
  return std::any_of(families.begin(), families.end(), [&](const std::vector<std::string>& family) {
    return std::count(family.begin(), family.end(), own[0]) > 0 &&
           std::count(family.begin(), family.end(), lost[0]) > 0;
  });
}

}  // namespace

std::vector<VerifiedModel> ModelsToVerify(const Knowledge& knowledge, const Asked& asked,
                                          const VerificationQuestion& question) {
  const std::vector<inference::ModelEvidence>& evidence = asked.evidence[0];
  const Names named(question.named.begin(), question.named.end());
  std::vector<VerifiedModel> kin, others;  // kin: what would be named the first
  std::set<Names> taken;
  Names leader;
  if (named.empty()) return {};
  for (const Index i : inference::LeadingModels(evidence, asked.probabilities[0], 0,
                                                static_cast<int>(evidence.size()))) {
    const inference::ModelEvidence& own = evidence[static_cast<std::size_t>(i)];
    const std::vector<std::string> names = EffectsNamed(knowledge, own.model);
    const Names each(names.begin(), names.end());
    if (names.empty() || taken.count(each) > 0) continue;
    const bool has_all = std::includes(each.begin(), each.end(), named.begin(), named.end());
    const bool first = leader.empty();
    const bool exchanged = !first && IsExchanged(each, leader, question.families);
    if (first ? !has_all
              : has_all || each.size() > leader.size() ||
                    (!exchanged && asked.probabilities[0].model[i] < question.sibling))
      continue;
    if (first) leader = each;
    taken.insert(each);
    (first || exchanged ? kin : others)
        .push_back({.effects = names, .optimum = BestDraw(knowledge, own.draws)});
  }
  kin.insert(kin.end(), std::make_move_iterator(others.begin()),
             std::make_move_iterator(others.end()));
  kin.resize(std::min(kin.size(), static_cast<std::size_t>(question.most)));
  return kin;
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
    for (const std::string& effect : model.effects) chances.try_emplace(effect, chance);
  }
  return chances;
}

}  // namespace calib::diagnosis
