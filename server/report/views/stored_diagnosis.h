#pragma once
// A diagnosis as it was kept at the server: of the JSON document of `calibctl diagnose` what other
// answers follow from.

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace calib::report {

/// Evidence of a model: the diagnosed one with these effects.
struct EvidenceOfEffects {
  std::vector<std::string> effects{};
  double log_evidence = 0, log_evidence_se = 0;
};

struct StoredDiagnosis {
  std::string campaign{};
  std::string digest{};   ///< SHA-256 of the document
  std::string verdict{};  ///< adequate | missing_effect | ambiguous | unexplained
  /// By one likelihood, of the base model, of each effect alone and of what is probable; empty
  /// where no effect was tried, and in older records.
  std::vector<EvidenceOfEffects> evidences{};
  bool only_adequacy = false;     ///< no effect was tried
  double chi2 = 0;                ///< squared misfit of the best fit
  std::string next_experiment{};  ///< the lines for the campaign file; empty: none was planned
  std::string then_file{};  ///< of a further measurement that the answer knows; empty: of none
};

/// INVALID_ARGUMENT when the text is no such document; fields of other versions are left out.
absl::StatusOr<StoredDiagnosis> ReadDiagnosis(const std::string& json);

/// The diagnosis of a campaign to show among several: the latest that tried effects, else the
/// latest; of equal verdicts the one that planned the next experiment. nullptr: there is none of
/// the campaign.
const StoredDiagnosis* LatestOf(const std::vector<StoredDiagnosis>& diagnoses,
                                const std::string& campaign);

}  // namespace calib::report
