// The live view of a running iteration.

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/ensemble.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/tempering.h"
#include "inference/numerics/log_weights.h"

namespace calib::inference {
namespace {

// Readings that count: whole load steps that every undiverged sample has reached; a gap ends the
// experiment.
std::vector<int> CommonReadings(const DataSet& data, const Eigen::MatrixXd& predictions,
                                const std::vector<Eigen::Index>& rows) {
  const StepOffsets steps = LoadSteps(data);
  std::vector<int> common;
  int ended = -1;  // experiment whose later steps no longer count
  for (int s = 0; s < steps.steps(); ++s) {
    const int experiment = data.readings[steps.offsets[s]].experiment;
    if (experiment == ended) continue;
    bool reached = true;
    for (int t = steps.offsets[s]; t < steps.offsets[s + 1]; ++t) {
      for (const Eigen::Index row : rows) reached = reached && std::isfinite(predictions(row, t));
    }
    if (!reached) {
      ended = experiment;
      continue;
    }
    for (int t = steps.offsets[s]; t < steps.offsets[s + 1]; ++t) common.push_back(t);
  }
  return common;
}

}  // namespace

OnlineView ViewOnline(const DataSet& data, const FilterOptions& options,
                      const Eigen::MatrixXd& predictions, std::span<const char> diverged) {
  assert(predictions.rows() == static_cast<Eigen::Index>(diverged.size()));
  assert(predictions.cols() == static_cast<Eigen::Index>(data.readings.size()));
  OnlineView view;
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < predictions.rows(); ++i) {
    if (!diverged[i]) rows.push_back(i);
  }
  if (rows.empty()) return view;
  view.ess = static_cast<double>(rows.size());
  std::vector<int> common = CommonReadings(data, predictions, rows);
  if (common.empty()) {  // some have hardly begun: those that have ended tell more than nothing
    rows.erase(std::remove_if(rows.begin(), rows.end(),
                              [&](Eigen::Index row) { return !predictions.row(row).allFinite(); }),
               rows.end());
    if (rows.empty()) return view;
    common = CommonReadings(data, predictions, rows);
  }
  view.readings = static_cast<int>(common.size());

  const bool ess_target = options.noise == NoiseMode::kEssTarget;
  const DataSet part = Restricted(ess_target ? WithRelativeErrors(data, 1) : data, common);
  Eigen::MatrixXd reached(rows.size(), common.size());
  for (std::size_t t = 0; t < common.size(); ++t) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      reached(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(t)) =
          predictions(rows[i], common[t]);
    }
  }
  const auto likelihood =
      GaussianLikelihood::Create(part, ess_target ? NoiseMode::kGiven : options.noise);
  if (!likelihood.ok()) return view;
  const Eigen::VectorXd log_likelihood = likelihood->LogLikelihood(reached);
  view.ess = EffectiveSampleSize(log_likelihood);
  if (ess_target) {
    const Eigen::VectorXd start = Eigen::VectorXd::Zero(log_likelihood.size());
    view.ess = FindExponent({.log_start = start,
                             .log_likelihood = log_likelihood,
                             .target = options.ess_target * static_cast<double>(predictions.rows()),
                             .max_exponent = std::numeric_limits<double>::infinity()})
                   .ess;
  }
  Eigen::Index best = 0;
  log_likelihood.maxCoeff(&best);
  view.best = static_cast<int>(rows[best]);
  double squares = 0;
  for (std::size_t t = 0; t < common.size(); ++t) {
    const Reading& reading = part.readings[t];
    const double scaled =
        (reached(best, static_cast<Eigen::Index>(t)) - reading.value) / reading.sd;
    squares += scaled * scaled;
  }
  view.best_rms = std::sqrt(squares / static_cast<double>(common.size()));
  return view;
}

}  // namespace calib::inference
