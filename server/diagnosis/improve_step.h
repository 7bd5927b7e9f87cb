#pragma once
// What improve decides from one model to the next, without running anything: which effects are
// tried, in which order, and whether a calibration with one of them is a step forward.

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/diagnosis.h"

namespace calib::diagnosis {

/// Effects to add to a model of this diagnosis, the one to be tried first in front: the named one;
/// of a group all of it, by evidence where that of every member is known and in the order of the
/// diagnosis otherwise; with `unexplained` the one that helps most, if any does. Empty: none.
std::vector<std::string> EffectsToTry(const Diagnosis& diagnosis);

/// Why the effect is added, a sentence.
std::string WhyNext(const Diagnosis& diagnosis, const std::string& effect);

/// Effects that may do better in the place of `added`, which this diagnosis had made be added and
/// with which the fitted readings are missed by rms_error still: at most two, in the order of the
/// diagnosis, whose refits came within twice that.
std::vector<std::string> OthersToTry(const Diagnosis& diagnosis, const std::string& added,
                                     double rms_error);

/// What is known of a calibrated model from the fitted data alone.
struct CalibratedModel {
  double rms_error = 0;  ///< as in report::Comparison
  bool has_posterior = false;
  double log_evidence = 0, log_evidence_se = 0;  ///< with a posterior; NaN: not known
  /// Of the parts that it is not fitted to, in sd of a measurement (see LeftOutErrors).
  std::optional<double> left_out_error{};
};

/// Empty: the model with the effect comes closer to the fitted data than the one without it, its
/// evidence is not lower by more than two standard errors and it predicts parts left out no worse,
/// where these are known of both. Otherwise what speaks against it, to follow "is no step: ".
std::string WhyNoStep(const CalibratedModel& without, const CalibratedModel& with);

}  // namespace calib::diagnosis
