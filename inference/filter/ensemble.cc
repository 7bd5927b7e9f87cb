#include "inference/filter/ensemble.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/data/gaussian_likelihood.h"
#include "inference/numerics/infinity.h"

namespace calib::inference {
namespace {

absl::Status ValidateShapes(const JointPrior& priors, const DataSet& data,
                            std::span<const Iteration> iterations) {
  if (iterations.empty()) return absl::FailedPreconditionError("there is no finished iteration.");
  const auto d = static_cast<Eigen::Index>(priors.size());
  const auto readings = static_cast<Eigen::Index>(data.readings.size());
  for (const Iteration& iteration : iterations) {
    const Eigen::Index n = iteration.parameters.rows();
    if (n == 0 || iteration.parameters.cols() != d || iteration.predictions.rows() != n ||
        iteration.predictions.cols() != readings ||
        (iteration.log_proposal && iteration.log_proposal->size() != n)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "an iteration has ", n, " x ", iteration.parameters.cols(), " parameters and ",
          iteration.predictions.rows(), " x ", iteration.predictions.cols(), " predictions; ", d,
          " parameters and ", readings, " readings are expected, one row per sample."));
    }
  }
  return absl::OkStatus();
}

// The sigma of kEssTarget: with errors for sigma = 1, ln L(sigma) = -chi^2 / (2 sigma) + const, so
// that 1 / sigma is an exponent of exp(-chi^2 / 2).
absl::Status FindSigma(const DataSet& data, const FilterOptions& options,
                       const Eigen::MatrixXd& predictions, Ensemble& ensemble) {
  ASSIGN_OR_RETURN(const auto unit,
                   GaussianLikelihood::Create(WithRelativeErrors(data, 1), NoiseMode::kGiven));
  const Eigen::VectorXd log_likelihood = unit.LogLikelihood(predictions);
  ensemble.tempering =
      FindExponent({.log_start = ensemble.log_start,
                    .log_likelihood = log_likelihood,
                    .target = options.ess_target * static_cast<double>(predictions.rows()),
                    .max_exponent = kInfinity});
  ensemble.sigma = 1 / ensemble.tempering.exponent;
  return absl::OkStatus();
}

// Whether a sample was drawn from no density.
bool IsGiven(const Iteration& iteration, Eigen::Index i) {
  return iteration.log_proposal && (*iteration.log_proposal)[i] == kInfinity;
}

bool IsAside(const Iteration& iteration, Eigen::Index i) {
  return !iteration.aside.empty() && iteration.aside[static_cast<std::size_t>(i)] != 0;
}

Eigen::Index CountStrangers(const Ensemble& ensemble) {
  Eigen::Index strangers = 0;
  Eigen::Index row = 0;
  for (const Iteration& iteration : ensemble.used) {
    for (Eigen::Index i = 0; i < iteration.parameters.rows(); ++i, ++row) {
      const bool outside = !iteration.log_proposal && ensemble.log_start[row] == -kInfinity;
      strangers += outside || IsGiven(iteration, i) || IsAside(iteration, i) ? 1 : 0;
    }
  }
  return strangers;
}

// Samples whose predictions are not all finite have weight zero. Their likelihood is zero, so that
// only rows of zero likelihood need a look.
void MarkDiverged(Ensemble& ensemble) {
  Eigen::Index row = 0;
  for (const Iteration& iteration : ensemble.used) {
    for (Eigen::Index i = 0; i < iteration.predictions.rows(); ++i, ++row) {
      if (IsAside(iteration, i)) {
        ensemble.log_start[row] = -kInfinity;
        ++ensemble.aside;
      } else if (ensemble.log_likelihood[row] == -kInfinity &&
                 !iteration.predictions.row(i).allFinite()) {
        ensemble.log_start[row] = -kInfinity;
        ++ensemble.diverged;
      } else if (ensemble.log_start[row] == -kInfinity && !IsGiven(iteration, i)) {
        ++ensemble.outside;
      }
    }
  }
}

std::string NoWeight(const Ensemble& ensemble) {
  const Eigen::Index n = ensemble.log_start.size();
  std::string text =
      absl::StrCat("no sample has a weight: of ", n, " samples ", ensemble.diverged,
                   " did not come to their ends and ", ensemble.outside, " lie outside the prior");
  if (ensemble.aside > 0) absl::StrAppend(&text, "; ", ensemble.aside, " are unknown");
  const Eigen::Index impossible = n - ensemble.diverged - ensemble.outside - ensemble.aside;
  if (impossible > 0) {
    absl::StrAppend(&text, "; the other ", impossible,
                    " are so far from the readings that their likelihood is zero: state larger "
                    "errors");
  } else {
    if (ensemble.diverged > 0) {
      absl::StrAppend(&text,
                      "; `calibctl samples` says why each ended: narrow the priors to where the "
                      "model runs");
    }
    if (ensemble.outside > 0) {
      absl::StrAppend(&text,
                      "; widen the priors to where the samples were drawn, or see whether their "
                      "units are those of the priors");
    }
  }
  return text + ".";
}

}  // namespace

Eigen::MatrixXd IncrementsOf(const GaussianLikelihood& likelihood,
                             std::span<const Iteration> iterations, bool reversed) {
  const auto of_one = [&](const Iteration& iteration) {
    return reversed ? likelihood.Increments(iteration.predictions.rowwise().reverse())
                    : likelihood.Increments(iteration.predictions);
  };
  if (iterations.size() == 1) return of_one(iterations.front());
  Eigen::Index n = 0;
  for (const Iteration& iteration : iterations) n += iteration.predictions.rows();
  Eigen::MatrixXd increments(n, likelihood.readings());
  Eigen::Index row = 0;
  for (const Iteration& iteration : iterations) {
    increments.middleRows(row, iteration.predictions.rows()) = of_one(iteration);
    row += iteration.predictions.rows();
  }
  return increments;
}

StepOffsets LoadSteps(const DataSet& data) {
  StepOffsets steps;
  for (int t = 0; t < static_cast<int>(data.readings.size()); ++t) {
    const bool begins = t == 0 || data.readings[t].experiment != data.readings[t - 1].experiment ||
                        data.readings[t].load_step != data.readings[t - 1].load_step;
    if (begins) steps.offsets.push_back(t);
  }
  steps.offsets.push_back(static_cast<int>(data.readings.size()));
  return steps;
}

absl::StatusOr<GaussianLikelihood> LikelihoodOf(const Ensemble& ensemble, const DataSet& data,
                                                const FilterOptions& options) {
  return options.noise == NoiseMode::kEssTarget
             ? GaussianLikelihood::Create(WithRelativeErrors(data, *ensemble.sigma),
                                          NoiseMode::kGiven)
             : GaussianLikelihood::Create(data, options.noise);
}

absl::StatusOr<Ensemble> MakeEnsemble(const JointPrior& priors, const DataSet& data,
                                      const FilterOptions& options,
                                      std::span<const Iteration> iterations) {
  RETURN_IF_ERROR(options.Validate());
  RETURN_IF_ERROR(ValidateData(data, options.noise));
  RETURN_IF_ERROR(priors.Validate());
  RETURN_IF_ERROR(ValidateShapes(priors, data, iterations));

  Ensemble ensemble;
  const bool last_only = options.noise == NoiseMode::kEssTarget;
  std::size_t count = 1;
  while (
      !last_only && count < iterations.size() &&
      SameFrozen(iterations[iterations.size() - 1 - count].proposal, iterations.back().proposal)) {
    ++count;
  }
  const auto used = iterations.last(count);
  ensemble.frozen = iterations.back().proposal.frozen;
  Eigen::Index n = 0;
  for (const Iteration& iteration : used) n += iteration.parameters.rows();
  for (const Iteration& iteration : iterations) ensemble.first += iteration.parameters.rows();
  ensemble.first -= n;
  ensemble.last_size = iterations.back().parameters.rows();

  ensemble.used = used;
  ensemble.parameters.resize(n, static_cast<Eigen::Index>(priors.size()));
  Eigen::Index row = 0;
  for (const Iteration& iteration : used) {
    ensemble.parameters.middleRows(row, iteration.parameters.rows()) = iteration.parameters;
    row += iteration.parameters.rows();
  }
  ensemble.log_start = LogImportance(priors, used);
  if (last_only) {
    RETURN_IF_ERROR(FindSigma(data, options, used.back().predictions, ensemble));
  }
  ASSIGN_OR_RETURN(const auto likelihood, LikelihoodOf(ensemble, data, options));
  ensemble.increments = IncrementsOf(likelihood, used, false);
  ensemble.log_likelihood = GaussianLikelihood::Sum(ensemble.increments);
  ensemble.strangers = CountStrangers(ensemble);
  MarkDiverged(ensemble);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (ensemble.log_start[i] > -kInfinity && ensemble.log_likelihood[i] > -kInfinity)
      return ensemble;
  }
  return absl::FailedPreconditionError(NoWeight(ensemble));
}

}  // namespace calib::inference
