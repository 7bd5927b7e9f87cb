#pragma once
// User's effects on the readings of a test in the periodic cell.

#include <vector>

#include "absl/status/status.h"
#include "dem/formula/formula.h"
#include "dem/measure/observables.h"
#include "dem/model/model.h"

namespace calib::dem {

/// Immutable; thread-safe.
class ReadingFormulas {
 public:
  /// Those effects of the model that change readings, in the order of their declaration.
  /// Precondition: ScenarioProblems() finds nothing wrong with the model.
  explicit ReadingFormulas(const Model& model);

  /// Every formula sees the readings as they come in. Changes of stresses and porosity pass on to
  /// what is derived from them (mean stress, ratios, void ratio, pore pressure), then those of
  /// derived readings follow. OUT_OF_RANGE: a formula is not finite, with the values it had.
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
