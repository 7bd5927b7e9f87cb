#include "server/diagnosis/improve_step.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/diagnosis/left_out_error.h"
#include "server/report/text/people_units.h"

namespace calib::diagnosis {
namespace {

constexpr std::size_t kOwnScale = 1;  // of kStrengthScales: the prior as it is
static_assert(kStrengthScales[kOwnScale] == 1);

std::vector<const CandidateEffect*> GroupOf(const Diagnosis& diagnosis) {
  const CandidateEffect& first = diagnosis.candidates.front();
  std::vector<const CandidateEffect*> group = {&first};
  for (const CandidateEffect& other : diagnosis.candidates) {
    const auto& names = first.confusable_with;
    if (&other != &first && std::find(names.begin(), names.end(), other.effect) != names.end()) {
      group.push_back(&other);
    }
  }
  return group;
}

}  // namespace

std::vector<std::string> EffectsToTry(const Diagnosis& diagnosis) {
  if (!diagnosis.effect.empty()) return {diagnosis.effect};
  if (diagnosis.verdict != "ambiguous") {
    return diagnosis.best_partial.empty() ? std::vector<std::string>{}
                                          : std::vector<std::string>{diagnosis.best_partial};
  }
  std::vector<const CandidateEffect*> group = GroupOf(diagnosis);
  if (std::all_of(group.begin(), group.end(),
                  [](const CandidateEffect* c) { return c->over_base_evidence.has_value(); })) {
    std::stable_sort(group.begin(), group.end(),
                     [](const CandidateEffect* a, const CandidateEffect* b) {
                       return a->over_base_evidence->log_evidence[kOwnScale] >
                              b->over_base_evidence->log_evidence[kOwnScale];
                     });
  }
  std::vector<std::string> names;
  names.reserve(group.size());
  for (const CandidateEffect* candidate : group) names.push_back(candidate->effect);
  return names;
}

std::string WhyNext(const Diagnosis& diagnosis, const std::string& effect) {
  if (!diagnosis.effect.empty()) return absl::StrCat(effect, " is named and added.");
  if (diagnosis.verdict != "ambiguous") {
    return absl::StrCat(effect, " is added, it helps most: ", diagnosis.reason, ".");
  }
  std::vector<std::string> others;
  for (const CandidateEffect* candidate : GroupOf(diagnosis)) {
    if (candidate->effect != effect) others.push_back(candidate->effect);
  }
  return absl::StrCat(effect, " is added, of a group that these tests do not tell apart: ",
                      absl::StrJoin(others, ", "), " as well.");
}

std::vector<std::string> OthersToTry(const Diagnosis& diagnosis, const std::string& added,
                                     double rms_error) {
  constexpr std::size_t kMost = 2;
  constexpr double kNear = 2;  // a refit has few runs: calibrations come closer
  std::vector<std::string> others;
  for (const CandidateEffect& candidate : diagnosis.candidates) {
    if (candidate.effect == added || candidate.campaign.empty()) continue;
    if (candidate.predicted_rms_error > kNear * rms_error) continue;
    others.push_back(candidate.effect);
    if (others.size() == kMost) break;
  }
  return others;
}

std::string WhyNoStep(const CalibratedModel& without, const CalibratedModel& with) {
  if (!(with.rms_error < without.rms_error)) {
    return absl::StrCat(with.has_posterior ? "" : "it has no posterior and ",
                        "it comes no closer, ", report::Number(with.rms_error, 3), " sd, ",
                        report::Number(without.rms_error, 3), " without it",
                        with.has_posterior ? "" : "; run more samples");
  }
  if (WorseLeftOut(without.left_out_error, with.left_out_error)) {
    return absl::StrCat("it comes closer, but not to parts that are left out of the fit, ",
                        report::Number(*with.left_out_error, 3), " sd, ",
                        report::Number(*without.left_out_error, 3), " without it");
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
