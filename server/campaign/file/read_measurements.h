#pragma once
// The keys `data`, `control` and `observables` of an experiment: from the laboratory's file to
// readings with errors.

#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// What decides how measurements are read.
struct MeasurementRules {
  /// Names that no catalogue knows are allowed, and the control is optional: nothing here drives
  /// the model.
  bool free_names = false;
  bool by_unit_only = false;  ///< columns are converted by unit, strains among them
  bool noise_needed =
      true;  ///< false with ess_target, where the readings themselves scale the errors
  /// False with the method table, which infers nothing: an observable need not have been measured.
  bool measured = true;
};

/// Fills path, control, segment and observables of the experiment (whose name and test are known).
void ReadMeasurements(MapReader& experiment_map, const MeasurementRules& rules,
                      ReadContext& context, Experiment& experiment);

}  // namespace calib::campaign
