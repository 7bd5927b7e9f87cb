#pragma once
// Effects of users on the readings of a test in the periodic cell.

#include <vector>

#include "absl/status/status.h"
#include "dem/formula/formula.h"
#include "dem/measure/observables.h"
#include "dem/model/model.h"

namespace calib::dem {

/// The effects of users that change readings, ready to be applied. Immutable; thread-safe.
class ReadingFormulas {
 public:
  /// Takes those effects of the model that change readings, in the order of their declaration.
  /// Precondition: ScenarioProblems() finds nothing wrong with the model.
  explicit ReadingFormulas(const Model& model);

  /// Changes the readings. Every formula sees them as they come in. Changes of stresses and
  /// porosity pass on to what is derived from them (mean stress, ratios, void ratio, pore
  /// pressure), then those of derived readings follow. Errors: OUT_OF_RANGE where a formula is not
  /// finite, with the values it had.
  absl::Status Apply(Measurement& measurement) const;

 private:
  struct Change {
    UserEffect effect;
    Formula formula;
    std::vector<double> parameters;
    double Measurement::*target;
  };
  std::vector<Change> changes_;
};

}  // namespace calib::dem
