#include "server/diagnosis/design_answer.h"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "calib/return_if_error.h"
#include "server/campaign/model/race.h"
#include "server/diagnosis/design_caps.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using inference::DesignPoints;

const RacingEffect& KeptEntry(const Knowledge& known, int place) {
  const int entry = known.part.kept[static_cast<std::size_t>(place)];
  return known.rows.race().effects[static_cast<std::size_t>(entry)];
}

// Pairs of the race as pairs of kept entries.
std::vector<std::pair<int, int>> KeptPairs(const Knowledge& known,
                                           const std::vector<std::pair<int, int>>& pairs) {
  const std::vector<int>& kept = known.part.kept;
  std::vector<std::pair<int, int>> result;
  for (const auto& [a, b] : pairs) {
    const auto x = std::find(kept.begin(), kept.end(), a),
               y = std::find(kept.begin(), kept.end(), b);
    if (x != kept.end() && y != kept.end())
      result.emplace_back(static_cast<int>(x - kept.begin()), static_cast<int>(y - kept.begin()));
  }
  return result;
}

// Chance of the misfit of each model that is probable enough to be asked, and of the base model; 0
// of the others and of none of these.
std::vector<double> ChancesOfMisfit(const KnownBefore& before, const Knowledge& known,
                                    const Asked& asked) {
  std::vector<double> chances;
  const auto parameters = static_cast<int>(known.rows.race().base.size());
  for (std::size_t i = 0; i < asked.evidence[0].size(); ++i) {
    const inference::ModelEvidence& own = asked.evidence[0][i];
    const bool wanted = own.model.effects.empty() ||
                        asked.probabilities[0].model[static_cast<Index>(i)] >= kDesignCaps.asked;
    chances.push_back(wanted && !own.model.none_of_these && own.draws.rows() > 0
                          ? ChanceOfMisfit(before, known, own.draws,
                                           parameters + static_cast<int>(own.model.effects.size()))
                          : 0);
  }
  return chances;
}

// Medians of strengths and shapes over the draws of the models that have an effect, by name, SI.
std::map<std::string, double> AmplitudeOf(const Knowledge& known, const Asked& asked,
                                          const std::string& effect) {
  std::map<std::string, std::vector<std::pair<double, double>>> values;  // with their weights
  const std::vector<std::string>& names = known.rows.names();
  for (std::size_t i = 0; i < asked.evidence[0].size(); ++i) {
    const inference::ModelEvidence& evidence = asked.evidence[0][i];
    const bool has =
        std::any_of(evidence.model.effects.begin(), evidence.model.effects.end(), [&](int k) {
          const int entry = known.part.kept[static_cast<std::size_t>(k)];
          return known.rows.race().effects[static_cast<std::size_t>(entry)].name == effect;
        });
    if (!has || evidence.draws.rows() == 0) continue;
    const double weight = asked.probabilities[0].model[static_cast<Index>(i)] /
                          static_cast<double>(evidence.draws.rows());
    const DesignPoints whole = WholePoints(known.rows, known.part, evidence.draws);
    for (Index r = 0; r < whole.rows(); ++r) {
      const std::vector<double> row = known.rows.Values(whole, r);
      for (std::size_t j = 0; j < names.size(); ++j) {
        if (campaign::EffectNamedIn(names[j]) == effect)
          values[names[j]].emplace_back(row[j], weight);
      }
    }
  }
  std::map<std::string, double> medians;
  for (auto& [name, own] : values) {
    std::sort(own.begin(), own.end());
    double total = 0, sum = 0;
    for (const auto& [value, weight] : own) total += weight;
    for (const auto& [value, weight] : own) {
      sum += weight;
      medians[name] = value;
      if (sum >= 0.5 * total) break;
    }
  }
  return medians;
}

}  // namespace

absl::StatusOr<Answer> AnswerOfDesign(const KnownBefore& before, const Knowledge& known,
                                      const Asked& asked, const VerificationChances& verification,
                                      double level) {
  const Race& race = known.rows.race();
  AnswerParts parts{.models = asked.space.models,
                    .widths = asked.probabilities,
                    .angles = known.angles,
                    .kin = KeptPairs(known, race.kin),
                    .verified = verification.has_value(),
                    .chance = ChancesOfMisfit(before, known, asked),
                    .level = level};
  if (verification) parts.verification = *verification;
  parts.adequacy_p = parts.chance.front();  // the base model is the first
  for (int i = 0; i < static_cast<int>(known.part.kept.size()); ++i)
    parts.effect_of.push_back(KeptEntry(known, i).name);
  for (std::size_t w = 0; w < asked.evidence.size(); ++w)
    parts.beyond.push_back(
        inference::BeyondDesign(asked.evidence[w], asked.probabilities[w], known.range));
  ASSIGN_OR_RETURN(Answer answer, AnswerFrom(parts));
  for (EffectAnswer& own : answer.candidates) {
    own.amplitude = AmplitudeOf(known, asked, own.effect);
    for (const int k : known.part.kept) {
      const RacingEffect& entry = race.effects[static_cast<std::size_t>(k)];
      if (entry.name == own.effect)
        own.visible[entry.strength] = entry.null + (entry.near > 0 ? 1 : -1) * known.rows.unit()[k];
    }
  }
  answer.not_excitable = race.not_excitable;
  for (const auto& [entry, why] : known.out)
    answer.not_excitable.emplace_back(race.effects[static_cast<std::size_t>(entry)].name, why);
  answer.warnings = known.warnings;
  return answer;
}

}  // namespace calib::diagnosis
