#pragma once
// Where a warm fit runs next: from everything that has been run of the extended model, those of the
// screen and of the base model at the effect's null among it.

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/emulator/emulated_posterior.h"
#include "server/diagnosis/effect_screen.h"
#include "server/report/views/run_table.h"

namespace calib::diagnosis {

/// The screen's runs with an effect as runs of the extended model; those that leave one of its
/// parameters open or lie outside its prior are left out. Sample numbers are empty.
report::RunTable RunsOfScreen(const std::vector<EffectScreen::EffectRun>& runs,
                              const campaign::Campaign& extended);

/// Runs of the model without the effects that `extended` has on top, as runs of `extended`: where a
/// parameter of an effect has its null value the others do not matter, so that they are spread over
/// their priors. Runs that cannot be expressed so are left out.
report::RunTable RunsWithoutEffect(const report::RunTable& without,
                                   const campaign::Campaign& parent,
                                   const campaign::Campaign& extended);

/// The same runs read by load cells with errors drawn from their priors in `extended`: a run at
/// every strength, and no run to be made. data: units of the histories. Empty where `extended` has
/// anything but load_cell_error on top, or it cannot be calculated (MisreadLoads).
std::optional<report::RunTable> RunsMisread(const report::RunTable& without,
                                            const campaign::Campaign& parent,
                                            const inference::DataSet& data,
                                            const campaign::Campaign& extended);

/// The rows of `more` behind those of `runs`.
void Append(const report::RunTable& more, report::RunTable& runs);

/// Posterior and evidence of the campaign on an emulator of the runs (histories in the sd of
/// readings.of_mean). Errors: those of inference::EmulatedPosterior.
absl::StatusOr<inference::EmulatedResult> Emulate(const campaign::Campaign& campaign,
                                                  const report::ScatteredReadings& readings,
                                                  const report::RunTable& runs);

/// `count` points, SI, where an emulator of the runs knows the model's history somewhere in the
/// prior: half of them about the draws of its posterior that it expects closest, half about all of
/// them, by errors wider while the model is far from the readings (inference/emulator:
/// search_widening.h); else from the prior. diverged: points, SI, of runs that came to no end, m x
/// d: twice as near to one of them as to any run, in standardised coordinates, a point is drawn
/// again, as long as others come in eight times as many draws. batch: number of batches so far,
/// decides the random numbers. Errors: those of inference::FitProposalToDraws and DrawSamples.
absl::StatusOr<Eigen::MatrixXd> NextPoints(const campaign::Campaign& campaign,
                                           const report::ScatteredReadings& readings,
                                           const report::RunTable& runs,
                                           const Eigen::MatrixXd& diverged, int batch, int count);

/// Points of the campaign's samples whose runs came to no end, SI, m x d.
Eigen::MatrixXd DivergedPoints(const report::CampaignView& view);

}  // namespace calib::diagnosis
