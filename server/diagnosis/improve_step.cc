#include "server/diagnosis/improve_step.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/report/text/people_units.h"

namespace calib::diagnosis {
namespace {

// Calibrations that a group may cost.
constexpr std::size_t kMostTried = 3;

bool IsSame(const std::vector<std::string>& a, const std::vector<std::string>& b) {
  return a.size() == b.size() && std::is_permutation(a.begin(), a.end(), b.begin());
}

}  // namespace

std::vector<const NamedModel*> ModelsToTry(const Answer& answer, int most) {
  std::vector<const NamedModel*> models;
  const bool named = answer.verdict == AnswerVerdict::kMissingEffect;
  double held = 0;
  for (const NamedModel& model : answer.probabilities) {
    const bool in_set = held < inference::AnswerLevels().set;
    held += model.probability;
    if (model.effects.empty() || static_cast<int>(model.effects.size()) > most) continue;
    if (named ? !IsSame(model.effects, answer.effects)
              : answer.verdict == AnswerVerdict::kAmbiguous && !in_set)
      continue;
    models.push_back(&model);
    if (answer.verdict != AnswerVerdict::kAmbiguous || models.size() == kMostTried) break;
  }
  return models;
}

std::string WhyNext(const Answer& answer, const NamedModel& model) {
  const std::string effects = absl::StrJoin(model.effects, " and ");
  const std::string are = model.effects.size() == 1 ? " is" : " are";
  if (answer.verdict == AnswerVerdict::kMissingEffect)
    return absl::StrCat(effects, are, " named and added.");
  const std::string probability = report::Percent(model.probability, 2);
  if (answer.verdict == AnswerVerdict::kAmbiguous) {
    return absl::StrCat(effects, are, " added, of what these tests do not tell apart (probability ",
                        probability, ").");
  }
  return absl::StrCat(effects, are, " added, the most probable of what does not explain all (",
                      probability, ").");
}

std::string WhyNoStep(const CalibratedModel& without, const CalibratedModel& with) {
  if (!(with.rms_error < without.rms_error)) {
    return absl::StrCat(with.has_posterior ? "" : "it has no posterior and ",
                        "it comes no closer, ", report::Number(with.rms_error, 3), " sd, ",
                        report::Number(without.rms_error, 3), " without it",
                        with.has_posterior ? "" : "; run more samples");
  }
  if (!without.has_posterior || !with.has_posterior) return "";
  const double gain = with.log_evidence - without.log_evidence;
  const double error = std::hypot(with.log_evidence_se, without.log_evidence_se);
  if (std::isfinite(gain) && std::isfinite(error) && gain < -2 * error) {
    return absl::StrCat("it comes closer, but the evidence is against it, by ",
                        report::Number(-gain, 3), " ± ", report::Number(error, 2),
                        " in ln p(data)");
  }
  return "";
}

}  // namespace calib::diagnosis
