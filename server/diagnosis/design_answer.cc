#include "server/diagnosis/design_answer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "calib/return_if_error.h"
#include "inference/numerics/log_weights.h"
#include "server/diagnosis/design_caps.h"
#include "server/diagnosis/design_effects.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

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

// Of two tests of one thing the smaller chance, doubled (Bonferroni).
double OfBoth(double a, double b) { return std::min(1.0, 2 * std::min(a, b)); }

// Chance of the misfit of each model that is probable enough to be asked, and of the base model; 0
// of the others and of none of these.
std::vector<double> ChancesOfMisfit(const KnownBefore& before, const Knowledge& known,
                                    const Asked& asked, const ChanceElsewhere& elsewhere) {
  std::vector<double> chances;
  const auto parameters = static_cast<int>(known.rows.race().base.size());
  for (std::size_t i = 0; i < asked.evidence[0].size(); ++i) {
    const inference::ModelEvidence& own = asked.evidence[0][i];
    const bool wanted = own.model.effects.empty() ||
                        asked.probabilities[0].model[static_cast<Index>(i)] >= kDesignCaps.asked;
    double chance = 0;
    if (wanted && !own.model.none_of_these && own.draws.rows() > 0) {
      chance = ChanceOfMisfit(*known.set, Eigen::VectorXd::Zero(before.base.histories.cols()),
                              own.draws, parameters + static_cast<int>(own.model.effects.size()));
      if (elsewhere) chance = OfBoth(chance, elsewhere(own));
    }
    chances.push_back(chance);
  }
  return chances;
}

// Sum of evidences under shares of a prior, and its error.
class SharedEvidence {
 public:
  // relative: R realisations of ln of the evidence over the base model's.
  void Add(double log_share, const inference::EvidenceEstimate& evidence,
           const Eigen::VectorXd& relative) {
    log_shares_.push_back(log_share);
    logs_.push_back(log_share + evidence.log_evidence);
    const double unknown = relative.size() > 1
                               ? std::sqrt((relative.array() - relative.mean()).square().sum() /
                                           static_cast<double>(relative.size() - 1))
                               : 0;
    errors_.push_back(std::hypot(evidence.standard_error, unknown));
  }
  void Tell(NamedModel& model) const {
    if (logs_.empty()) return;
    const double log_sum = inference::LogSumExp(AsVector(logs_));
    model.log_evidence = log_sum - inference::LogSumExp(AsVector(log_shares_));
    double square = 0;
    for (std::size_t i = 0; i < logs_.size(); ++i)
      square += std::pow(std::exp(logs_[i] - log_sum) * errors_[i], 2);
    model.log_evidence_se = std::sqrt(square);
  }

 private:
  static Eigen::VectorXd AsVector(const std::vector<double>& values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Index>(values.size()));
  }
  std::vector<double> log_shares_, logs_, errors_;
};

// Evidences of models by names: those of strengths of one effect are one, weighed by their shares
// of the prior.
void TellEvidences(const Knowledge& known, const Asked& asked, Answer& answer) {
  const Eigen::VectorXd log_prior = asked.space.LogPrior();
  const std::vector<inference::ModelEvidence>& evidence = asked.evidence[0];
  std::map<std::set<std::string>, SharedEvidence> by_names;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    const inference::ModelEvidence& own = evidence[i];
    if (own.model.none_of_these || !std::isfinite(own.evidence.log_evidence) ||
        !std::isfinite(own.evidence.standard_error))
      continue;
    const std::vector<std::string> names = EffectsNamed(known, own.model);
    by_names[{names.begin(), names.end()}].Add(
        log_prior[static_cast<Index>(i)], own.evidence,
        own.realised - evidence.front().realised);  // the base model is the first
  }
  for (NamedModel& model : answer.probabilities) {
    const auto found = by_names.find({model.effects.begin(), model.effects.end()});
    if (!model.none_of_these && found != by_names.end()) found->second.Tell(model);
  }
}

}  // namespace

void TellMisfit(const BaseMisfit& misfit, Answer& answer) {
  answer.adequacy_p = misfit.chance;
  answer.square = misfit.square;
  answer.degrees = misfit.degrees;
  answer.p_square = misfit.chance_of_square;
  answer.rms = misfit.rms;
  answer.missed = misfit.missed;
  answer.scatter = misfit.scatter;
}

absl::StatusOr<Answer> AnswerOfDesign(const KnownBefore& before, const Knowledge& known,
                                      const Asked& asked, const BaseMisfit& misfit,
                                      const VerificationChances& verification, double level,
                                      const ChanceElsewhere& elsewhere) {
  const Race& race = known.rows.race();
  AnswerParts parts{.models = asked.space.models,
                    .widths = asked.probabilities,
                    .angles = known.angles,
                    .kin = KeptPairs(known, race.kin),
                    .verified = verification.has_value(),
                    .chance = ChancesOfMisfit(before, known, asked, elsewhere),
                    .level = level};
  if (verification) parts.verification = *verification;
  // The base model is the first.
  parts.adequacy_p = parts.chance.front() =
      elsewhere ? OfBoth(misfit.chance, elsewhere(asked.evidence[0].front())) : misfit.chance;
  for (int i = 0; i < static_cast<int>(known.part.kept.size()); ++i)
    parts.effect_of.push_back(KeptEntry(known, i).name);
  for (std::size_t w = 0; w < asked.evidence.size(); ++w) {
    parts.beyond.push_back(
        inference::BeyondDesign(asked.evidence[w], asked.probabilities[w], known.range));
  }
  ASSIGN_OR_RETURN(Answer answer, AnswerFrom(parts));
  TellMisfit(misfit, answer);
  answer.adequacy_p = parts.adequacy_p;
  TellEvidences(known, asked, answer);
  RETURN_IF_ERROR(DescribeEffects(before, known, asked, answer));
  answer.not_excitable = race.not_excitable;
  // An effect of which another strength is seen takes part; of two that are not, one reason is
  // enough.
  for (const auto& [entry, why] : known.out) {
    const std::string& name = race.effects[static_cast<std::size_t>(entry)].name;
    const auto is_known = [&name](const auto& said) { return said.first == name; };
    if (std::count(parts.effect_of.begin(), parts.effect_of.end(), name) == 0 &&
        std::none_of(answer.not_excitable.begin(), answer.not_excitable.end(), is_known))
      answer.not_excitable.emplace_back(name, why);
  }
  answer.warnings = known.warnings;
  answer.sentence = VerdictInWords(answer);
  return answer;
}

}  // namespace calib::diagnosis
