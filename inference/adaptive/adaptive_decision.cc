#include "inference/adaptive/adaptive_decision.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Chance below which fresh runs count as not predicted, and least share of their coordinates in
// 90 % intervals: of six runs and as many coordinates seven tenths are missed by chance in one case
// of a thousand (binomial law).
constexpr double kLeastChance = 1e-3;
constexpr double kLeastCoverage = 0.7;
constexpr double kNinety = 1.6448536269514722;  // standard normal quantile of 0.95
// Part of a coordinate's variance that must be predicted for there to be a signal; the best of
// several emulators of thirty runs predicts a tenth of what is chance alone.
constexpr double kLeastPredicted = 0.2;
// Squared errors over those claimed beyond which an emulator does not follow a response, as for
// EmulatedResult; and emulated scatter over what repeats show, with its chance.
constexpr double kMostCalibration = 2;
constexpr double kMostOverRepeats = 2;
constexpr double kLeastRepeatsChance = 1e-3;
// Squared errors over those of repeats from which it is the model that varies and not chance; of
// four repeats and several coordinates chance makes less than four.
constexpr double kSharpDifference = 4;
// Chance below which the model misses the readings: of a thousand calibrations of a right model,
// of twenty-five decisions each, one in forty meets it by chance.
constexpr double kLeastMissChance = 1e-6;
// Decisions in a row that must find that more runs are for nothing: two batches apart, as for what
// has settled.
constexpr int kForNothing = 3;
// A width of the posterior over the prior's beyond which the readings say next to nothing.
constexpr double kUntold = 0.8;
// Standard error of a mean, in sd, that more runs are asked for to reach.
constexpr double kWantedError = 0.1;

// Largest moves between two posteriors within the options' limits.
bool HasSettled(const AdaptiveMemory& before, const AdaptiveMemory& after,
                const AdaptiveOptions& options) {
  if (before.sd.size() == 0 || after.sd.size() == 0 || before.batches >= after.batches)
    return false;
  const Eigen::ArrayXd sd = after.sd.array().max(1e-300);
  return ((after.mean - before.mean).array().abs() / sd).maxCoeff() < options.mean_moves &&
         (before.sd.array() / sd - 1).abs().maxCoeff() < options.width_moves;
}

absl::StatusOr<AdaptiveVerification> Verify(const AdaptiveProblem& problem,
                                            const AdaptiveRuns& runs, int batch,
                                            std::uint64_t seed) {
  const AdaptiveRuns before = runs.Before(batch);
  ASSIGN_OR_RETURN(const ResponseEmulator emulator, ResponseEmulator::Fit(problem, before, seed));
  std::vector<Index> complete;
  AdaptiveVerification result;
  for (Index i = before.rows(); i < runs.rows(); ++i) {
    if (runs.end[static_cast<std::size_t>(i)] == RunEnd::kComplete) {
      complete.push_back(i);
    } else {
      ++result.lost;
    }
  }
  result.runs = static_cast<int>(complete.size());
  if (complete.empty()) return result;
  const Eigen::MatrixXd at = StandardRows(problem.prior, runs.parameters(complete, Eigen::all));
  const EmulatorPrediction prediction = emulator.Predict(at);
  const Eigen::ArrayXXd variance =
      prediction.variance.array().rowwise() + emulator.errors().specimen.transpose().array();
  const Eigen::ArrayXXd square =
      (emulator.Turned(runs.coordinates(complete, Eigen::all)) - prediction.mean).array().square() /
      variance.max(1e-300);
  const auto count = static_cast<double>(square.size());
  const double freedom = static_cast<double>(emulator.quality().complete) / 2;
  result.chance = FisherLaw{.numerator = count, .denominator = freedom}.Tail(square.mean());
  result.coverage = static_cast<double>((square < kNinety * kNinety).count()) / count;
  // Coordinates of one run are off together where its parameters are.
  result.passed =
      result.chance > kLeastChance && result.coverage >= kLeastCoverage && result.lost <= 1;
  return result;
}

// Why an emulator is not fit, or nothing.
std::string WhyUnfit(const ResponseQuality& quality) {
  const bool missed =
      (quality.over_repeats > kMostOverRepeats && quality.repeats_chance < kLeastRepeatsChance);
  if (missed) {
    return absl::StrFormat(
        "The emulator cannot follow the model: runs are missed by %.1f times the variance that "
        "repeats of the same parameters differ by.",
        quality.over_repeats);
  }
  if (quality.calibration > kMostCalibration) {
    return absl::StrFormat(
        "The emulator cannot follow the model: squared errors of runs left out are %.1f times "
        "those "
        "that it claims; at most %.0f are allowed.",
        quality.calibration, kMostCalibration);
  }
  if (quality.explained < kLeastPredicted && quality.errors_over_repeats > kSharpDifference) {
    return absl::StrFormat(
        "The emulator cannot follow the model: of no coordinate more than %.0f %% of the variance "
        "over the prior is explained, and repeats of the same parameters differ by %.1f times less "
        "variance than runs are missed by.",
        std::max(0.0, 100 * quality.explained), quality.errors_over_repeats);
  }
  if (quality.explained < kLeastPredicted) {
    return absl::StrFormat(
        "The scatter of the runs swallows the signal: of no coordinate more than %.0f %% of the "
        "variance over the prior is explained by the parameters.",
        std::max(0.0, 100 * quality.explained));
  }
  return "";
}

// The readings' distance at the draw of the posterior that is nearest to them, in sd of all that is
// known to part them.
struct Miss {
  double rms = 0;     ///< of coordinates
  double chance = 1;  ///< of as large a one, by Fisher's law
};

Miss MissOf(const ResponseEmulator& emulator, const AdaptivePosterior& posterior) {
  const EmulatorPrediction prediction = emulator.Predict(posterior.standard);
  const Eigen::MatrixXd variance = DiagonalVariance(prediction, emulator.errors());
  const double least =
      ((prediction.mean.rowwise() - emulator.measured().transpose()).array().square() /
       variance.array().max(1e-300))
          .rowwise()
          .sum()
          .minCoeff();
  const auto q = static_cast<double>(emulator.coordinates());
  const double fitted = static_cast<double>(posterior.mean.size());
  const double freedom = std::max(1.0, q - fitted);
  return {.rms = std::sqrt(least / q),
          .chance = FisherLaw{.numerator = freedom,
                              .denominator = static_cast<double>(emulator.quality().complete) / 2}
                        .Tail(least / freedom)};
}

// All runs that there may be, given ones too.
Index MostRuns(const AdaptiveOptions& options) {
  return options.max_runs + options.given.parameters.rows();
}

// Whether a mean stays uncertain up to the last of them, its error falling with their root.
bool StaysUncertain(const AdaptivePosterior& posterior, Index runs,
                    const AdaptiveOptions& options) {
  const double falls =
      std::sqrt(static_cast<double>(runs) / static_cast<double>(MostRuns(options)));
  return (posterior.mean_error.array() / posterior.sd.array().max(1e-300)).maxCoeff() * falls >
         options.mean_error;
}

// What is uncertain, and what more runs would bring.
std::string WhatIsUncertain(const AdaptivePosterior& posterior, Index runs,
                            const std::vector<std::string>& names) {
  const auto name = [&names](Index j) {
    return names.empty() ? absl::StrCat("parameter ", j + 1) : names[static_cast<std::size_t>(j)];
  };
  std::vector<std::string> untold, unsure;
  double factor = 1;
  for (Index j = 0; j < posterior.mean.size(); ++j) {
    if (posterior.sd[j] > kUntold) untold.push_back(name(j));
    const double error = posterior.mean_error[j] / std::max(posterior.sd[j], 1e-300);
    factor = std::max(factor, std::pow(error / kWantedError, 2));
    if (error > kWantedError)
      unsure.push_back(absl::StrFormat("%s (its mean to %.2f of its sd)", name(j), error));
  }
  std::string result;
  if (!untold.empty()) {
    absl::StrAppend(&result, " The readings say next to nothing of ", absl::StrJoin(untold, ", "),
                    ".");
  }
  if (!unsure.empty()) {
    absl::StrAppend(
        &result, " By the emulator's error uncertain is ", absl::StrJoin(unsure, ", "), "; about ",
        static_cast<int>(std::ceil(static_cast<double>(runs) * std::min(factor, 100.0))),
        " runs would bring all means to ", kWantedError, " sd.");
  }
  return result;
}

AdaptiveDecision Refused(std::string reason, bool propose_filter) {
  AdaptiveDecision result{.stage = AdaptiveStage::kRefused, .reason = std::move(reason)};
  if (propose_filter) absl::StrAppend(&result.reason, " The filter needs no emulator.");
  result.propose_filter = propose_filter;
  result.memory.stage = result.stage;
  return result;
}

}  // namespace

absl::Status AdaptiveOptions::Validate() const {
  const auto at_least = [](const char* name, double found, double least) -> absl::Status {
    if (found >= least) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(name, " is ", found, "; at least ", least));
  };
  RETURN_IF_ERROR(at_least("max_runs", max_runs, 1));
  RETURN_IF_ERROR(at_least("batch", batch, 1));
  RETURN_IF_ERROR(at_least("explore", explore, 0));
  RETURN_IF_ERROR(at_least("first_per_parameter", first_per_parameter, 1));
  RETURN_IF_ERROR(at_least("repeats", repeats, 0));
  RETURN_IF_ERROR(at_least("verify", verify, 1));
  if (explore > batch) {
    return absl::InvalidArgumentError(
        absl::StrCat("explore is ", explore, "; at most batch, ", batch));
  }
  if (!(mean_moves > 0) || !(width_moves > 0) || !(mean_error > 0)) {
    return absl::InvalidArgumentError("mean_moves, width_moves and mean_error are to be above 0");
  }
  return absl::OkStatus();
}

int FirstRunsOf(Index parameters, const AdaptiveOptions& options) {
  const auto d = static_cast<int>(parameters);
  return std::max(options.first_per_parameter * d,
                  static_cast<int>(ResponseEmulator::LeastRuns(parameters)) + 1);
}

int LeastMaxRuns(Index parameters, const AdaptiveOptions& options) {
  return FirstRunsOf(parameters, options) + 2 * options.batch + options.verify;
}

bool MayOverlap(std::span<const AdaptiveMemory> earlier) {
  return earlier.size() >= 2 && earlier.back().stage != AdaptiveStage::kVerifying;
}

absl::StatusOr<AdaptiveDecision> DecideAdaptive(const AdaptiveProblem& problem,
                                                const AdaptiveRuns& all,
                                                std::span<const AdaptiveMemory> earlier,
                                                const AdaptiveOptions& options) {
  RETURN_IF_ERROR(options.Validate());
  RETURN_IF_ERROR(problem.Validate());
  RETURN_IF_ERROR(all.Validate(problem));
  const AdaptiveRuns runs = all.Ended();
  const auto d = static_cast<Index>(problem.prior.size());
  const auto batches = static_cast<int>(earlier.size());
  const auto batches_of = [](const AdaptiveRuns& some) {
    return some.rows() == 0 ? 0 : some.batch.back() + 1;
  };
  const int ended = batches_of(runs);
  if (batches_of(all) != batches) {
    return absl::InvalidArgumentError(
        absl::StrCat("runs of ", batches_of(all), " batches, and ", batches, " earlier decisions"));
  }
  if (batches > 0 &&
      (ended == 0 || (ended < batches && earlier.back().stage == AdaptiveStage::kVerifying))) {
    return absl::InvalidArgumentError("there is nothing to decide before more runs have ended");
  }
  if (batches == 0) {
    const int least = LeastMaxRuns(d, options);
    if (options.max_runs < least) {
      return Refused(absl::StrCat("max_runs is ", options.max_runs, ", and ", d,
                                  " parameters take ", least, " runs at least: ",
                                  FirstRunsOf(d, options), " that fill the prior, two batches of ",
                                  options.batch, " and ", options.verify, " that judge."),
                     false);
    }
    AdaptiveDecision result;
    const int first = FirstRunsOf(d, options);
    const AdaptiveBatch& given = options.given;
    AdaptiveBatch fill =
        FirstRuns(problem, first, std::min(options.repeats, first / 3), options.seed, given);
    const Index count = given.parameters.rows();
    result.next.parameters.resize(count + fill.parameters.rows(), d);
    if (count > 0) result.next.parameters.topRows(count) = given.parameters;
    result.next.parameters.bottomRows(fill.parameters.rows()) = fill.parameters;
    result.next.packing = given.packing;
    result.next.packing.insert(result.next.packing.end(), fill.packing.begin(), fill.packing.end());
    return result;
  }

  const auto complete =
      static_cast<Index>(std::count(runs.end.begin(), runs.end.end(), RunEnd::kComplete));
  const auto left = static_cast<int>(MostRuns(options) - all.rows());
  if (complete < ResponseEmulator::LeastRuns(d)) {
    const std::string found =
        complete == 0 ? absl::StrCat("None of ", runs.rows(), " runs is complete")
                      : absl::StrCat("Of ", runs.rows(), " runs ", complete, " are complete");
    return Refused(absl::StrCat(found, "; an emulator of ", d, " parameters takes ",
                                ResponseEmulator::LeastRuns(d),
                                ". There is no posterior: the prior may lie where the model cannot "
                                "be run."),
                   false);
  }
  const auto emulator = ResponseEmulator::Fit(problem, runs, options.seed);
  if (!emulator.ok()) return Refused(std::string(emulator.status().message()), true);
  ASSIGN_OR_RETURN(const KnownRegion region,
                   KnownRegion::Fit(StandardRows(problem.prior, runs.parameters), runs));
  AdaptiveSamplingOptions sampling = options.sampling;
  sampling.seed = options.seed;
  sampling.number = static_cast<std::uint64_t>(batches);
  AdaptivePosterior posterior = SamplePosterior(problem, *emulator, region, sampling);

  AdaptiveDecision result;
  result.memory.batches = ended;
  result.quality = emulator->quality();
  const std::string unfit = WhyUnfit(emulator->quality());
  const bool sampled = posterior.draws.rows() > 0;
  if (sampled) {
    result.memory.mean = posterior.mean;
    result.memory.sd = posterior.sd;
  }
  if (earlier.back().stage == AdaptiveStage::kVerifying) {
    ASSIGN_OR_RETURN(result.verification, Verify(problem, runs, batches - 1, options.seed));
  }
  const bool settled = batches >= 2 && HasSettled(earlier[static_cast<std::size_t>(batches - 1)],
                                                  result.memory, options);
  const bool settled_before =
      batches >= 3 && HasSettled(earlier[static_cast<std::size_t>(batches - 2)],
                                 earlier[static_cast<std::size_t>(batches - 1)], options);
  const bool known =
      sampled && ((posterior.mean_error.array() / posterior.sd.array().max(1e-300)).maxCoeff() <
                  options.mean_error);
  const bool ends = left < 1 || (left < options.batch && left < options.verify);
  const auto end = [&](AdaptiveStage stage, std::string reason) {
    result.stage = result.memory.stage = stage;
    result.reason = std::move(reason);
    return result;
  };
  if (!sampled) return Refused("The emulator gives the readings no density anywhere.", true);
  // An emulator that is not fit yet may be with more runs; without a signal it never will.
  if (!unfit.empty() && (ends || emulator->quality().explained < kLeastPredicted))
    return Refused(unfit, true);
  const Miss miss = MissOf(*emulator, posterior);
  if (unfit.empty() && StaysUncertain(posterior, runs.rows(), options)) {
    const AdaptiveMemory& before = earlier.back();
    const int more = before.batches < ended ? 1 : 0;
    result.memory.uncertain = before.uncertain + more;
    if (miss.chance < kLeastMissChance) result.memory.missing = before.missing + more;
  }
  const bool for_nothing = result.memory.uncertain >= kForNothing;
  const std::string uncertain = WhatIsUncertain(posterior, runs.rows(), options.names);
  if (result.verification.passed && settled && known && unfit.empty()) {
    result.posterior = std::move(posterior);
    return end(AdaptiveStage::kConverged, uncertain.empty() ? "" : uncertain.substr(1));
  }
  if (result.memory.missing >= kForNothing) {
    result.posterior = std::move(posterior);
    return end(
        AdaptiveStage::kNotConverged,
        absl::StrFormat(
            "Ended after %d runs: the model misses the readings by %.1f sd of noise, scatter "
            "and what the emulator does not know together (chance %.0e), and up to %d runs "
            "no posterior would come of it. Where it fails and which effect it lacks are the "
            "questions before that of its parameters.",
            runs.rows(), miss.rms, miss.chance, MostRuns(options)));
  }
  if (result.verification.passed && settled && for_nothing) {
    result.posterior = std::move(posterior);
    return end(
        AdaptiveStage::kNotConverged,
        absl::StrFormat("Ended after %d runs: the posterior has settled and fresh runs of it "
                        "were predicted, but up to %d runs not all means would be known to "
                        "%.2f sd. That error is in the intervals.%s",
                        runs.rows(), MostRuns(options), options.mean_error, uncertain));
  }
  if (ends) {
    result.posterior = std::move(posterior);
    std::string why = absl::StrCat("Not converged after ", runs.rows(), " runs: ");
    if (!settled || !settled_before) {
      absl::StrAppend(&why, "the posterior has not settled.");
    } else if (!known) {
      absl::StrAppend(&why, "means are not known to ", options.mean_error, " sd.");
    } else if (earlier.back().stage == AdaptiveStage::kVerifying) {
      absl::StrAppend(
          &why, absl::StrFormat("fresh runs were not predicted (chance %.2g, %.0f %% in "
                                "90 %% intervals, %d lost).",
                                result.verification.chance, 100 * result.verification.coverage,
                                result.verification.lost));
    } else {
      absl::StrAppend(&why, "no runs are left to judge by.");
    }
    return end(AdaptiveStage::kNotConverged, absl::StrCat(why, uncertain));
  }

  const bool just_failed = earlier.back().stage == AdaptiveStage::kVerifying;
  const bool last = left < options.batch + options.verify;
  const bool verify =
      unfit.empty() && left >= options.verify &&
      ((settled && settled_before && (known || for_nothing) && !just_failed) || last);
  if (verify) {
    result.stage = AdaptiveStage::kVerifying;
    result.next = VerifyingRuns(problem, all, posterior, options.verify);
  } else {
    result.stage = AdaptiveStage::kSearching;
    const int count = std::min(options.batch, left);
    result.next = NextBatch(problem, all, *emulator, region, posterior,
                            {.runs = count,
                             .explore = std::min(options.explore, count),
                             .seed = options.seed,
                             .number = sampling.number});
  }
  result.memory.stage = result.stage;
  result.reason = unfit;
  result.posterior = std::move(posterior);
  return result;
}

}  // namespace calib::inference
