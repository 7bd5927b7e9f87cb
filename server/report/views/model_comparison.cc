#include "server/report/views/model_comparison.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/model/identity.h"
#include "server/campaign/model/words.h"
#include "server/messages/read_words.h"

namespace calib::report {
namespace {

constexpr double kRounding = 1e-9;  // of a stated error

absl::Status CheckRivals(const std::vector<RivalModel>& rivals) {
  if (rivals.size() < 2) {
    return absl::InvalidArgumentError("name at least two campaigns to compare");
  }
  std::set<std::string> seen;
  for (const RivalModel& rival : rivals) {
    if (!seen.insert(rival.posterior.campaign()).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("campaign ", rival.posterior.campaign(), " is named twice"));
    }
  }
  return absl::OkStatus();
}

bool HasEvidence(const v1::Posterior& posterior) {
  return messages::SourceOf(posterior) != campaign::PosteriorSource::kNone &&
         std::isfinite(posterior.log_evidence()) && std::isfinite(posterior.log_evidence_se());
}

// The first that has none; empty: all have.
std::string WithoutEvidence(const std::vector<RivalModel>& rivals) {
  for (const RivalModel& rival : rivals) {
    if (!HasEvidence(rival.posterior)) return rival.posterior.campaign();
  }
  return "";
}

absl::Status CheckErrors(const std::vector<RivalModel>& rivals) {
  for (const RivalModel& rival : rivals) {
    if (rival.campaign.filter.noise != inference::NoiseMode::kEssTarget) continue;
    return absl::FailedPreconditionError(
        absl::StrCat("campaign ", rival.posterior.campaign(),
                     " has its errors tempered to an effective sample size (ess_target), so that "
                     "its evidence says nothing about the model; run it with noise: given or "
                     "noise: inferred"));
  }
  return absl::OkStatus();
}

bool IsExtensionOf(const RivalModel& rival, const std::string& parent) {
  const auto& lineage = rival.campaign.lineage;
  return lineage && lineage->parent == parent &&
         campaign::ValueOf(campaign::kDerivedForWords, lineage->purpose) ==
             campaign::DerivedFor::kExtension;
}

// Effects that a model has and the base has not.
std::set<std::string> EffectsBeyond(const campaign::Campaign& base,
                                    const campaign::Campaign& campaign) {
  std::set<std::string> effects(campaign.model.effects.begin(), campaign.model.effects.end());
  for (const std::string& own : base.model.effects) effects.erase(own);
  return effects;
}

absl::StatusOr<std::vector<inference::EvidenceEstimate>> EvidencesOfDiagnosis(
    const std::vector<RivalModel>& rivals, const std::vector<StoredDiagnosis>& diagnoses) {
  const std::string without = WithoutEvidence(rivals), base = BaseOf(rivals);
  const std::string why = absl::StrCat("campaign ", without,
                                       " has no evidence, because it has no posterior: see "
                                       "`calibctl posterior ",
                                       without, "` for why");
  if (base.empty()) return absl::FailedPreconditionError(why);
  const StoredDiagnosis* const diagnosis = LatestOf(diagnoses, base);
  if (diagnosis == nullptr || diagnosis->evidences.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        why, "; `calibctl diagnose ", base, "` gives evidences of it and its extensions"));
  }
  const auto is_base = [&base](const RivalModel& r) { return r.posterior.campaign() == base; };
  const RivalModel& first = *std::find_if(rivals.begin(), rivals.end(), is_base);
  std::vector<inference::EvidenceEstimate> evidence;
  for (const RivalModel& rival : rivals) {
    const auto wanted = EffectsBeyond(first.campaign, rival.campaign);
    const auto found =
        std::find_if(diagnosis->evidences.begin(), diagnosis->evidences.end(),
                     [&wanted](const EvidenceOfEffects& own) {
                       return std::set(own.effects.begin(), own.effects.end()) == wanted;
                     });
    if (found == diagnosis->evidences.end()) {
      return absl::FailedPreconditionError(
          absl::StrCat(why, ", and the diagnosis of ", base, " gives none of the model of ",
                       rival.posterior.campaign(), ": it took no part or was not probable"));
    }
    evidence.push_back(
        {.log_evidence = found->log_evidence, .standard_error = found->log_evidence_se});
  }
  return evidence;
}

absl::Status CheckSameData(const std::vector<RivalModel>& rivals) {
  const std::string first = campaign::DataDigest(rivals.front().campaign);
  for (const RivalModel& rival : rivals) {
    if (campaign::DataDigest(rival.campaign) != first) {
      return absl::FailedPreconditionError(absl::StrCat(
          "campaigns ", rivals.front().posterior.campaign(), " and ", rival.posterior.campaign(),
          " were fitted to different readings; evidences of different data cannot be compared"));
    }
  }
  return absl::OkStatus();
}

// The errors that weigh the readings are the same in both.
bool SameErrors(const campaign::Campaign& a, const campaign::Campaign& b) {
  const inference::DataSet x = campaign::MakeDataSet(a);
  const inference::DataSet y = campaign::MakeDataSet(b);
  if (a.filter.noise != b.filter.noise) return false;
  return std::equal(x.readings.begin(), x.readings.end(), y.readings.begin(), y.readings.end(),
                    [](const auto& i, const auto& j) {
                      return std::abs(i.sd - j.sd) <= kRounding * std::max(i.sd, j.sd);
                    });
}

std::vector<std::string> Warnings(const std::vector<RivalModel>& rivals) {
  std::vector<std::string> warnings;
  const auto names = [&rivals](auto chosen) {
    std::string list;
    for (const RivalModel& rival : rivals) {
      if (chosen(rival))
        absl::StrAppend(&list, list.empty() ? "" : ", ", rival.posterior.campaign());
    }
    return list;
  };
  const campaign::Campaign& first = rivals.front().campaign;
  const std::string others =
      names([&first](const RivalModel& r) { return !SameErrors(first, r.campaign); });
  if (!others.empty()) {
    warnings.push_back(absl::StrCat(
        "The errors of the readings are not stated as in ", rivals.front().posterior.campaign(),
        ": ", others, "; the evidence compares models and errors together, not the models alone."));
  }
  const std::string methods = names(
      [&first](const RivalModel& r) { return r.campaign.method->name() != first.method->name(); });
  if (!methods.empty()) {
    warnings.push_back(
        absl::StrCat("The evidence was not found by the same method as that of ",
                     rivals.front().posterior.campaign(), ": ", methods,
                     "; differences within a few standard errors may be those of the methods."));
  }
  const std::string open = names([](const RivalModel& r) { return !r.posterior.converged(); });
  if (!open.empty()) {
    warnings.push_back(absl::StrCat("Not converged: ", open, "; its evidence is provisional."));
  }
  const std::string emulated = names([](const RivalModel& r) {
    return messages::SourceOf(r.posterior) == campaign::PosteriorSource::kEmulator;
  });
  if (!emulated.empty()) {
    warnings.push_back(
        absl::StrCat("Evidence from an emulator of the runs: ", emulated,
                     "; its standard error holds what halves of the runs differ by."));
  }
  return warnings;
}

}  // namespace

std::string BaseOf(const std::vector<RivalModel>& rivals) {
  for (const RivalModel& base : rivals) {
    std::set<std::string> line = {base.posterior.campaign()};
    for (bool grows = true; grows;) {
      grows = false;
      for (const RivalModel& rival : rivals) {
        const bool joins = std::any_of(line.begin(), line.end(), [&rival](const std::string& id) {
          return IsExtensionOf(rival, id);
        });
        grows = (joins && line.insert(rival.posterior.campaign()).second) || grows;
      }
    }
    if (line.size() == rivals.size()) return base.posterior.campaign();
  }
  return "";
}

absl::StatusOr<ModelComparison> CompareModels(const std::vector<RivalModel>& rivals,
                                              const std::vector<StoredDiagnosis>& diagnoses) {
  RETURN_IF_ERROR(CheckRivals(rivals));
  RETURN_IF_ERROR(CheckErrors(rivals));
  RETURN_IF_ERROR(CheckSameData(rivals));
  ModelComparison comparison;
  std::vector<inference::EvidenceEstimate> evidence;
  if (const std::string without = WithoutEvidence(rivals); without.empty()) {
    for (const RivalModel& rival : rivals) {
      evidence.push_back({.log_evidence = rival.posterior.log_evidence(),
                          .standard_error = rival.posterior.log_evidence_se()});
    }
    comparison.warnings = Warnings(rivals);
  } else {
    ASSIGN_OR_RETURN(evidence, EvidencesOfDiagnosis(rivals, diagnoses));
    comparison.evidence_from = "diagnosis";
    comparison.warnings = {absl::StrCat(
        "The evidences are those of the diagnosis of ", BaseOf(rivals), ", since ", without,
        " has no posterior: all by one emulator and one likelihood, of what is smooth in the "
        "readings, strengths under the prior of the diagnosis.")};
  }
  const auto probabilities = inference::ModelProbabilities(evidence);
  for (std::size_t k = 0; k < rivals.size(); ++k) {
    comparison.models.push_back({.campaign = rivals[k].posterior.campaign(),
                                 .name = rivals[k].campaign.name,
                                 .log_evidence = evidence[k].log_evidence,
                                 .log_evidence_se = evidence[k].standard_error,
                                 .probability = probabilities[k]});
  }
  std::stable_sort(comparison.models.begin(), comparison.models.end(),
                   [](const ComparedModel& a, const ComparedModel& b) {
                     return a.log_evidence > b.log_evidence;
                   });
  return comparison;
}

}  // namespace calib::report
