#include "inference/emulator/emulated_posterior.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/return_if_error.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/emulator/emulated_likelihood.h"
#include "inference/emulator/emulated_path.h"
#include "inference/emulator/emulated_target.h"
#include "inference/emulator/stopped_runs.h"
#include "inference/filter/parameter_summary.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/sampling/philox.h"
#include "inference/scatter/moved_draws.h"
#include "inference/tmcmc/tmcmc.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Draws for a predictive p-value of some readings; chosen: one of a few per cent is known to 1 %.
constexpr Index kStageDraws = 500;

struct CollectedRuns {
  Runs finished;
  Runs stopped;  // NaN where they have no reading
};

// One below the other.
void Append(const Eigen::RowVectorXd& input, const Eigen::RowVectorXd& history, Index& used,
            Runs& runs) {
  runs.inputs.row(used) = input;
  runs.histories.row(used) = history;
  ++used;
}

absl::StatusOr<CollectedRuns> CollectRuns(const JointPrior& priors, const DataSet& data,
                                          std::span<const Iteration> iterations) {
  const auto t = static_cast<Index>(data.readings.size());
  const auto d = static_cast<Index>(priors.size());
  Eigen::RowVectorXd value(t);
  Eigen::RowVectorXd sd(t);
  for (Index k = 0; k < t; ++k) {
    value[k] = data.readings[static_cast<std::size_t>(k)].value;
    sd[k] = data.readings[static_cast<std::size_t>(k)].sd;
  }
  Index total = 0;
  for (const Iteration& iteration : iterations) total += iteration.parameters.rows();
  const Runs none{.inputs = Eigen::MatrixXd(total, d), .histories = Eigen::MatrixXd(total, t)};
  CollectedRuns runs{.finished = none, .stopped = none};
  Index finished = 0;
  Index stopped = 0;
  for (const Iteration& iteration : iterations) {
    if (iteration.parameters.cols() != d || iteration.predictions.cols() != t ||
        iteration.parameters.rows() != iteration.predictions.rows()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "an iteration has ", iteration.parameters.rows(), " x ", iteration.parameters.cols(),
          " parameters and ", iteration.predictions.rows(), " x ", iteration.predictions.cols(),
          " predictions; there are ", d, " priors and ", t, " readings."));
    }
    const Eigen::MatrixXd standard = ToStandard(priors, iteration.parameters);
    const bool partial = iteration.stopped.rows() == standard.rows();
    for (Index i = 0; i < standard.rows(); ++i) {
      if (!standard.row(i).allFinite()) continue;
      const auto history = [&](const Eigen::MatrixXd& rows) -> Eigen::RowVectorXd {
        return (rows.row(i) - value).cwiseQuotient(sd);
      };
      if (iteration.predictions.row(i).allFinite()) {
        Append(standard.row(i), history(iteration.predictions), finished, runs.finished);
      } else if (partial && iteration.stopped.row(i).array().isFinite().any()) {
        Append(standard.row(i), history(iteration.stopped), stopped, runs.stopped);
      }
    }
  }
  for (const auto& [used, some] :
       {std::pair(finished, &runs.finished), std::pair(stopped, &runs.stopped)}) {
    some->inputs.conservativeResize(used, d);
    some->histories.conservativeResize(used, t);
  }
  return runs;
}

// The readings are zero in the emulator's units.
Eigen::VectorXd MisfitOf(const StateEmulator& emulator, const ScorePrediction& prediction) {
  const PrincipalComponents& components = emulator.components();
  const Eigen::MatrixXd histories =
      (prediction.mean * components.basis.transpose()).rowwise() + components.mean;
  return (histories.rowwise().squaredNorm() / static_cast<double>(histories.cols())).cwiseSqrt();
}

// Histories of the model at the draws: the mean history and what is not known of it.
void AddPredictive(const DataSet& data, const StateEmulator& emulator,
                   const ScorePrediction& prediction, std::uint64_t seed, EmulatedResult& result) {
  const Index n = prediction.mean.rows();
  const Index q = prediction.mean.cols();
  const auto t = static_cast<Index>(data.readings.size());
  const Eigen::MatrixXd factor = Eigen::LLT<Eigen::MatrixXd>(emulator.correlation()).matrixL();
  Eigen::MatrixXd scores(n, q);
  Eigen::VectorXd normal(q);
  for (Index i = 0; i < n; ++i) {
    PhiloxStream stream({.seed = seed,
                         .purpose = StreamPurpose::kEmulatorBand,
                         .iteration = 0,
                         .sample = static_cast<std::uint64_t>(i)});
    for (double& z : normal) z = stream.Normal();
    scores.row(i) =
        prediction.mean.row(i) + (factor * normal).transpose().cwiseProduct(prediction.sd.row(i));
  }
  const PrincipalComponents& components = emulator.components();
  result.predictive_mean.resize(t);
  const std::pair<double, Eigen::VectorXd*> quantiles[] = {
      {0.025, &result.predictive_q025}, {0.05, &result.predictive_q05},
      {0.25, &result.predictive_q25},   {0.5, &result.predictive_q50},
      {0.75, &result.predictive_q75},   {0.95, &result.predictive_q95},
      {0.975, &result.predictive_q975}};
  for (const auto& [p, quantile] : quantiles) quantile->resize(t);
  std::vector<double> history(static_cast<std::size_t>(n));
  for (Index k = 0; k < t; ++k) {
    const Reading& reading = data.readings[static_cast<std::size_t>(k)];
    const Eigen::VectorXd column = scores * components.basis.row(k).transpose();
    for (Index i = 0; i < n; ++i) {
      history[static_cast<std::size_t>(i)] =
          reading.value + reading.sd * (components.mean[k] + column[i]);
    }
    result.predictive_mean[k] = reading.value + reading.sd * (components.mean[k] + column.mean());
    std::sort(history.begin(), history.end());
    for (const auto& [p, quantile] : quantiles) {
      (*quantile)[k] = history[static_cast<std::size_t>(p * static_cast<double>(history.size()))];
    }
  }
}

void AddScatter(const DataSet& data, const StateEmulator& emulator, EmulatedResult& result) {
  const auto t = static_cast<Index>(data.readings.size());
  Eigen::VectorXd sd(t);
  for (Index k = 0; k < t; ++k) sd[k] = data.readings[static_cast<std::size_t>(k)].sd;
  const Eigen::MatrixXd factor = Eigen::LLT<Eigen::MatrixXd>(emulator.correlation()).matrixL();
  result.scatter_factor =
      sd.asDiagonal() * emulator.components().basis * emulator.scatter_sd().asDiagonal() * factor;
  result.scatter_white = sd.array().square() * emulator.components().remainder.array();
}

// Draws of the posterior under errors whose scatter is that of refits (refit_spread.h). prediction:
// at the draws.
void Widen(const JointPrior& priors, const DataSet& data, const EmulatorOptions& options,
           const StateEmulator& emulator, const ScorePrediction& prediction,
           const std::vector<Index>& free, EmulatedResult& result) {
  Eigen::VectorXd sd(static_cast<Index>(data.readings.size()));
  for (Index k = 0; k < sd.size(); ++k) sd[k] = data.readings[static_cast<std::size_t>(k)].sd;
  const Eigen::MatrixXd histories =
      prediction.mean * emulator.components().basis.transpose() * sd.asDiagonal();
  MovedDraws moved =
      MoveByRefits(priors, data, *options.replicates, result.draws, histories, free, options.seed);
  result.draws = std::move(moved.draws);
  result.widened = moved.widened;
}

double PredictiveP(const EmulatedLikelihood& likelihood, const ScorePrediction& prediction,
                   std::size_t readings, const KnownFrom& known) {
  const Eigen::VectorXd misfit = likelihood.Misfit(prediction);
  double sum = 0;
  for (const double chi_squared : misfit) {
    sum += UpperTail(std::max(0.0, chi_squared), static_cast<double>(readings), known);
  }
  return sum / static_cast<double>(misfit.size());
}

// EmulatedResult::stage_p, by some of the draws, evenly spread.
std::vector<double> StageP(const EmulatedLikelihood& likelihood, const ScorePrediction& prediction,
                           const std::vector<JudgedReadings>& stages) {
  const Index stride = std::max<Index>(1, prediction.mean.rows() / kStageDraws);
  const auto thinned = Eigen::seq(0, prediction.mean.rows() - 1, stride);
  const ScorePrediction some{.mean = prediction.mean(thinned, Eigen::all),
                             .sd = prediction.sd(thinned, Eigen::all)};
  std::vector<double> p;
  for (const JudgedReadings& stage : stages) {
    const std::vector<Index> readings(stage.readings.begin(), stage.readings.end());
    p.push_back(PredictiveP(likelihood.Of(readings), some, readings.size(), stage.known));
  }
  return p;
}

// The errors in units of the noise sd of each reading, with kInferred sqrt(variance) times that
// stated; T variances.
void StateErrors(const TrainedEmulator& trained, const Eigen::VectorXd& variance,
                 EmulatedResult& result) {
  const CrossValidation& check = trained.emulator.cross_validation();
  const auto runs = static_cast<double>(check.error.rows());
  const Eigen::ArrayXd square = check.error.colwise().squaredNorm().transpose().array() / runs;
  const Eigen::ArrayXd in_units = square / variance.array();
  result.reading_error = in_units.sqrt();
  result.cross_validated_error = std::sqrt(in_units.mean());
  // Its share of the errors' square is known for all readings together.
  result.scatter =
      check.scatter_rms * (check.rms > 0 ? result.cross_validated_error / check.rms : 1);
  result.calibration = check.calibration;
  result.runs = trained.runs;
  result.components = static_cast<int>(trained.emulator.components().basis.cols());
  result.local = trained.local;
}

// What the draws say of the noise.
void AddNoise(const DataSet& data, const EmulatedTarget& target, const Eigen::MatrixXd& noise,
              const Eigen::VectorXd& log_weights, EmulatedResult& result) {
  for (std::size_t e = 0; e < target.cells().size(); ++e) {
    const ErrorCells& cells = target.cells()[e];
    Eigen::VectorXd probability = Eigen::VectorXd::Zero(cells.levels());
    for (const double level : noise.col(static_cast<Index>(e))) {
      probability[static_cast<Index>(level)] += 1 / static_cast<double>(noise.rows());
    }
    result.model_errors.push_back(SummarizeModelError(data.model_errors[e], cells, probability));
  }
  if (!target.cells().empty() || noise.cols() == 0) return;
  result.variance_factors.resize(noise.cols());
  result.noise_scale.resize(noise.cols(), 3);
  for (Index g = 0; g < noise.cols(); ++g) {
    result.variance_factors[g] = WeightedQuantile(log_weights, noise.col(g), 0.5);
    for (Index k = 0; k < 3; ++k) {
      constexpr double kQuantiles[] = {0.05, 0.5, 0.95};
      result.noise_scale(g, k) =
          std::sqrt(WeightedQuantile(log_weights, noise.col(g), kQuantiles[k]));
    }
  }
}

// What multiplies the stated variances over the posterior: median factors, or the mean over levels.
Eigen::VectorXd TypicalVariances(const EmulatedTarget& target, const Eigen::MatrixXd& noise,
                                 const EmulatedResult& result) {
  if (target.cells().empty()) return target.LargerVariances(result.variance_factors.transpose());
  constexpr Index kDraws = 200;  // chosen: a mean variance to a tenth of its spread
  const Index stride = std::max<Index>(1, noise.rows() / kDraws);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(target.LargerVariances({}).size());
  Index draws = 0;
  for (Index i = 0; i < noise.rows(); i += stride, ++draws) {
    sum += target.LargerVariances(noise.row(i));
  }
  return sum / static_cast<double>(draws);
}

// A path that cannot be had leaves the posterior as it is.
absl::Status AddPaths(const EmulatedTarget& target, const EmulatedLikelihood& likelihood,
                      const DataSet& data, const StateEmulator& emulator,
                      const EmulatorOptions& options, const std::stop_token& stop,
                      EmulatedResult& result) {
  const EmulatedPathOptions path{.draws = options.path_draws,
                                 .target_cv = options.target_cv,
                                 .steps = options.steps,
                                 .seed = options.seed};
  auto forward = EmulatedPath(target, likelihood, data, path, stop);
  if (absl::IsFailedPrecondition(forward.status())) return absl::OkStatus();
  ASSIGN_OR_RETURN(result.path, std::move(forward));
  if (!options.reversed_path) return absl::OkStatus();
  const DataSet reversed = Reversed(data);
  ASSIGN_OR_RETURN(
      const auto of_reversed,
      EmulatedLikelihood::Create(reversed, emulator,
                                 {.scatter_share = options.training.scatter_share,
                                  .model_error = options.noise == NoiseMode::kModelError,
                                  .reversed = true}));
  ASSIGN_OR_RETURN(result.reversed_path, EmulatedPath(target, of_reversed, reversed, path, stop));
  return absl::OkStatus();
}

// The result of an emulator that is of no use anywhere: not one prior draw lies where it knows the
// model's history.
EmulatedResult KnowsNothing(const EmulatorOptions& options, const TrainedEmulator& trained) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  EmulatedResult result;
  StateErrors(trained, Eigen::VectorXd::Ones(trained.emulator.cross_validation().error.cols()),
              result);
  result.log_evidence = result.log_evidence_se = result.emulator_sd = kNone;
  result.reason = absl::StrFormat(
      "Nowhere in the prior does an emulator of %d runs know the mean history of the model to "
      "within %g standard deviations of the readings' noise: run more samples, or fewer "
      "parameters.",
      trained.runs, options.max_error);
  return result;
}

// The verdict.
void Judge(const EmulatorOptions& options, EmulatedResult& result) {
  const double shared = options.training.scatter_share * result.scatter * result.scatter;
  const double uncovered = std::sqrt(
      std::max(0.0, result.cross_validated_error * result.cross_validated_error - shared));
  result.adequate = false;
  if (result.cross_validated_error > options.max_error) {
    result.reason = absl::StrFormat(
        "The emulator misses its own runs by %.1f standard deviations of the readings' noise "
        "(limit %g), of which it puts "
        "%.1f down to the scatter of single runs: run more samples near the posterior or fewer "
        "parameters, or state a "
        "larger noise.",
        result.cross_validated_error, options.max_error, result.scatter);
  } else if (uncovered > options.max_uncovered) {
    result.reason = absl::StrFormat(
        "The emulator misses its own runs by %.1f standard deviations of the readings' noise "
        "beyond the scatter that the "
        "measurement is taken to share (limit %g): run more samples near the posterior, or give "
        "the measurement a larger "
        "share of the scatter.",
        uncovered, options.max_uncovered);
  } else if (result.calibration > options.max_calibration) {
    result.reason = absl::StrFormat(
        "The emulator's errors on its own runs are %.1f times as large as it claims (limit %.1f): "
        "the response is not "
        "smooth on the scale of the runs, run more samples near the posterior.",
        std::sqrt(result.calibration), std::sqrt(options.max_calibration));
  } else if (result.emulator_sd > options.max_unknown) {
    result.reason = absl::StrFormat(
        "The emulated posterior lies where few runs are: the mean history of the model is known "
        "there to %.1f standard deviations of the readings' noise only (limit %g), and what is not "
        "known excuses misfit. Runs there would tell, unless the model misses the readings.",
        result.emulator_sd, options.max_unknown);
  } else {
    result.adequate = true;
  }
}

}  // namespace

absl::Status EmulatorOptions::Validate() const {
  const auto wrong = [](const char* name, double found, const char* allowed) {
    return absl::InvalidArgumentError(
        absl::StrCat("emulator: ", name, " is ", found, "; allowed is ", allowed, "."));
  };
  if (noise == NoiseMode::kEssTarget) {
    return absl::InvalidArgumentError(
        "emulator: noise by effective sample size is a tempering of the runs' own weights and has "
        "no emulated posterior; "
        "give the noise or let it be inferred.");
  }
  RETURN_IF_ERROR(training.Validate());
  if (replicates && replicates->departures.rows() < 2) {
    return wrong("replicates", static_cast<double>(replicates->departures.rows()), "2 or more");
  }
  if (draws < 100 || draws > 100000) return wrong("draws", draws, "100 to 1e5");
  if (!(target_cv > 0 && target_cv <= 2)) return wrong("target_cv", target_cv, "above 0 up to 2");
  if (path_draws != 0 && (path_draws < 100 || path_draws > 100000)) {
    return wrong("path_draws", path_draws, "0 (no path) or 100 to 1e5");
  }
  if (steps < 1) return wrong("steps", steps, "1 or more");
  if (!(max_error > 0)) return wrong("max_error", max_error, "above 0");
  if (!(max_uncovered > 0)) return wrong("max_uncovered", max_uncovered, "above 0");
  if (!(max_calibration > 1)) return wrong("max_calibration", max_calibration, "above 1");
  if (!(max_unknown > 0)) return wrong("max_unknown", max_unknown, "above 0");
  return absl::OkStatus();
}

absl::StatusOr<EmulatedResult> EmulatedPosterior(const JointPrior& priors, const DataSet& data,
                                                 const EmulatorOptions& options,
                                                 std::span<const Iteration> iterations,
                                                 const std::stop_token& stop) {
  RETURN_IF_ERROR(options.Validate());
  RETURN_IF_ERROR(ValidateData(data, options.noise));
  RETURN_IF_ERROR(priors.Validate());
  ASSIGN_OR_RETURN(const auto runs, CollectRuns(priors, data, iterations));
  ASSIGN_OR_RETURN(const auto trained,
                   TrainWithStopped(runs.finished, runs.stopped, data, options.training,
                                    {.max_unknown = options.max_error, .seed = options.seed}));
  ASSIGN_OR_RETURN(
      const auto likelihood,
      EmulatedLikelihood::Create(data, trained.emulator,
                                 {.scatter_share = options.training.scatter_share,
                                  .model_error = options.noise == NoiseMode::kModelError}));

  const auto d = static_cast<Index>(priors.size());
  int known = 0;  // points sampled where the emulator knows the model's history
  const EmulatedTarget target(priors, data, options.noise, options.max_error, trained.emulator,
                              iterations);
  const TmcmcOptions sampler{.samples = options.draws,
                             .target_cv = options.target_cv,
                             .steps = options.steps,
                             .seed = options.seed};
  const auto state = RunTmcmc(
      target.prior(), sampler,
      [&](const Eigen::MatrixXd& points) {
        const EmulatedPoints at = target.At(points);
        Eigen::VectorXd values = likelihood.LogLikelihood(at.prediction, at.noise);
        for (Index i = 0; i < values.size(); ++i) {
          if (target.IsKnown(at.unknown[i])) {
            ++known;
          } else {
            values[i] = -std::numeric_limits<double>::infinity();
          }
        }
        return values;
      },
      stop);
  // The sampler needs two to begin with.
  if (!state.ok() && known < 2 && absl::IsFailedPrecondition(state.status())) {
    return KnowsNothing(options, trained);
  }
  RETURN_IF_ERROR(state.status());

  EmulatedResult result;
  result.draws = target.Complete(state->samples);
  result.log_evidence = state->log_evidence;
  result.log_evidence_se = state->LogEvidenceStandardError();
  ScorePrediction prediction = target.Predict(result.draws);
  const Eigen::MatrixXd noise = target.Noise(state->samples);
  const double unknown = target.Unknown(prediction.sd, noise).sum();
  if (options.noise == NoiseMode::kGiven) {
    result.predictive_p = PredictiveP(likelihood, prediction, data.readings.size(), options.known);
    result.stage_p = StageP(likelihood, prediction, options.stages);
  }
  if (options.replicates && options.noise == NoiseMode::kGiven) {
    Widen(priors, data, options, trained.emulator, prediction, target.free(), result);
    prediction = target.Predict(result.draws);
  }
  const Index n = result.draws.rows();
  const Eigen::VectorXd log_weights =
      Eigen::VectorXd::Constant(n, -std::log(static_cast<double>(n)));
  for (Index j = 0; j < d; ++j) {
    result.parameters.push_back(
        Summarize(priors[static_cast<std::size_t>(j)], log_weights, result.draws.col(j)));
    const std::optional<double> held = target.Held(j);
    if (!held) continue;
    ParameterSummary& fixed = result.parameters.back();
    fixed.mean = *held;
    fixed.sd = fixed.cov = fixed.q05 = fixed.q50 = fixed.q95 =
        std::numeric_limits<double>::quiet_NaN();
    fixed.at_bound = false;
  }
  result.correlation = CorrelationOf(
      WeightedCovariance(log_weights, result.draws, WeightedMean(log_weights, result.draws)));
  AddNoise(data, target, noise, log_weights, result);
  StateErrors(trained, TypicalVariances(target, noise, result), result);
  result.emulator_sd =
      std::sqrt(unknown / (static_cast<double>(n) * static_cast<double>(data.readings.size())));
  result.misfit = MisfitOf(trained.emulator, prediction);
  AddScatter(data, trained.emulator, result);
  AddPredictive(data, trained.emulator, prediction, options.seed, result);
  Judge(options, result);
  if (options.path_draws > 0 && result.adequate) {
    RETURN_IF_ERROR(AddPaths(target, likelihood, data, trained.emulator, options, stop, result));
  }
  return result;
}

}  // namespace calib::inference
