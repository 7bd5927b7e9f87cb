#pragma once
// By how much more runs with effects on scatter about an additive emulator, from the runs
// themselves.

#include "absl/status/statusor.h"
#include "inference/diagnosis/feature_emulator.h"

namespace calib::inference {

/// The emulator with the RunVariance, on a grid of kappa1 in {0, 0.01, 0.03, 0.1, 0.3} and kappa2
/// in {0, 0.003, 0.01, 0.03, 0.1}, under which runs left out are most probable, prior variances
/// held at those of the emulator without; then its variances anew. A run left out is missed by r /
/// (1 - h) with variance sigma^2 / (w (1 - h)), h its leverage: both are exact for
/// linear features.                              [Rasmussen & Williams 2006, sec. 5.4.2]
/// Errors: as FeatureEmulator::Fit.
absl::StatusOr<FeatureEmulator> FitWithRunVariance(const EffectFeatures& features,
                                                   const EmulatorData& data,
                                                   FeatureEmulatorOptions options = {});

}  // namespace calib::inference
