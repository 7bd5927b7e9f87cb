#pragma once
// The campaigns that belong together: a base model, what was tried on it, what joined it.

#include <optional>
#include <string>
#include <vector>

#include "server/campaign/model/words.h"
#include "server/report/views/comparison.h"
#include "server/report/views/stored_diagnosis.h"
#include "server/report/views/stored_improvement.h"

namespace calib::report {

/// A campaign of the family. Screens and other tables of runs are left out.
struct Relative {
  std::string campaign, name;
  std::string parent;                             ///< id; empty: the base
  std::optional<campaign::DerivedFor> purpose{};  ///< extension or warm fit; empty: the base
  std::vector<std::string> effects;
  double log_evidence = 0;
};

/// One model on the way from the base to the campaign of the report.
struct ErrorStep {
  std::string campaign;
  std::vector<std::string> effects;
  double rms_error = 0;
  /// Set for the first and the last model alone: held-out data do not choose between models.
  std::optional<double> heldout_rms_error;
  std::vector<ObservableMisfit> by_observable;
  std::vector<SegmentMisfit> by_segment{};
};

/// All that a report tells of how a model came about.
struct Story {
  std::vector<Relative> family;  ///< parents before their children
  std::vector<ErrorStep> steps;  ///< base first; fewer than two: nothing was added
  std::vector<ParameterDrift> drift;
  /// Diagnoses of the campaigns on the way, in the order in which they were stored.
  std::vector<StoredDiagnosis> diagnoses{};
  /// The last improvement that the campaign took part in.
  std::optional<StoredImprovement> improvement{};
  bool known = false;  ///< the server was asked
};

}  // namespace calib::report
