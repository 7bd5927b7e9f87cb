#pragma once
// What a step of improve rests on: which models are tried next, why, and whether one is a step.
// Pure.

#include <string>
#include <vector>

#include "server/diagnosis/answer.h"

namespace calib::diagnosis {

/// Models to be calibrated one after the other until one is a step, with at most `most` effects:
/// the one that is named; else those of the credible set, most probable first, and where nothing is
/// explained the most probable one alone. Pointers into the answer.
std::vector<const NamedModel*> ModelsToTry(const Answer& answer, int most);

/// Why this one, in a sentence.
std::string WhyNext(const Answer& answer, const NamedModel& model);

/// A calibration as a step of improve.
struct CalibratedModel {
  double rms_error = 0;  ///< of the fitted data
  bool has_posterior = true;
  double log_evidence = 0, log_evidence_se = 0;
};

/// Empty: the model with the effects comes closer to the fitted data than the one without them, and
/// its evidence is not lower by more than two standard errors. Otherwise what speaks against it, to
/// follow "is no step: ".
std::string WhyNoStep(const CalibratedModel& without, const CalibratedModel& with);

}  // namespace calib::diagnosis
