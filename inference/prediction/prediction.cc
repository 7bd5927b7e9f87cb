#include "inference/prediction/prediction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/special_functions.h"
#include "inference/numerics/standard_normal.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr Index kMoreThanParameters = 4;  // runs to tell the parts apart; chosen: 3 are for scatter
constexpr double kReach = 8;              // sd of a component beyond which it has no mass in double
constexpr int kQuantileSteps = 100;       // of the bisection: to the last bit
constexpr int kPlaceSteps = 40;           // of the bisection: to 1e-12 of the distance
constexpr int kShares = 200;              // equally probable shared errors; chosen
constexpr double kTinySpread = 1e-300;    // in the place of a zero that is divided by

// Pr(Q_t >= level), the mean over draws of the normal tails.
double Exceeds(const QuantityPrediction& prediction, Index t, double level) {
  const double sd = prediction.conditional_sd[t];
  double sum = 0;
  for (const double mean : prediction.conditional_mean.col(t)) {
    sum += sd > 0 ? 0.5 * std::erfc((level - mean) / (sd * std::sqrt(2.0)))
                  : (mean >= level ? 1.0 : 0.0);
  }
  return sum / static_cast<double>(prediction.conditional_mean.rows());
}

// Quantile of the mixture by bisection between all that its components reach.
double Quantile(const QuantityPrediction& prediction, Index t, double p) {
  const double sd = prediction.conditional_sd[t];
  double low = prediction.conditional_mean.col(t).minCoeff() - kReach * sd;
  double high = prediction.conditional_mean.col(t).maxCoeff() + kReach * sd;
  for (int step = 0; step < kQuantileSteps && low < high; ++step) {
    const double middle = low + 0.5 * (high - low);
    if (middle <= low || middle >= high) break;
    (Exceeds(prediction, t, middle) > 1 - p ? low : high) = middle;
  }
  return low + 0.5 * (high - low);
}

// The mean of so few runs is not the posterior's: as much as one run more.
double MeanStretch(const QuantityPrediction& prediction) {
  return std::sqrt(1 + 1 / static_cast<double>(prediction.conditional_mean.rows()));
}

// Of the law that is stretched about its median, which is known.
double StretchedQuantile(const QuantityPrediction& prediction, Index t, double p, double middle) {
  const double stretch =
      StudentRatio(prediction.freedom, std::min(p, 1 - p)) * MeanStretch(prediction);
  return middle + stretch * (Quantile(prediction, t, p) - middle);
}

void SetQuantiles(QuantityPrediction& result) {
  const Index t = result.mean.size();
  result.q05.resize(t);
  result.q50.resize(t);
  result.q95.resize(t);
  for (Index k = 0; k < t; ++k) {
    const double middle = result.q50[k] = Quantile(result, k, 0.5);
    result.q05[k] = StretchedQuantile(result, k, 0.05, middle);
    result.q95[k] = StretchedQuantile(result, k, 0.95, middle);
  }
}

// Pr(Q_t >= level) of the stretched law, whose quantile of probability p lies from the median by
// sqrt(1 + 1/N) t_p / z_p times that of the mixture: the place in the mixture that the stretch
// takes to the level is found by bisection between the median and the level.
double StretchedExceeds(const QuantityPrediction& prediction, Index t, double level) {
  const double middle = prediction.q50[t];
  const double mean_stretch = MeanStretch(prediction);
  double near = middle;
  double far = level;
  for (int step = 0; step < kPlaceSteps; ++step) {
    const double place = near + 0.5 * (far - near);
    if (place == near || place == far) break;
    const double above = Exceeds(prediction, t, place);
    const double tail = std::min(above, 1 - above);
    const double reached =
        mean_stretch * StudentRatio(prediction.freedom, tail) * std::abs(place - middle);
    (reached < std::abs(level - middle) ? near : far) = place;
  }
  return Exceeds(prediction, t, far);
}

}  // namespace

absl::StatusOr<QuantityPrediction> PredictQuantity(const Eigen::MatrixXd& parameters,
                                                   const Eigen::MatrixXd& runs,
                                                   const Eigen::VectorXd& error_sd, bool scatters) {
  const Index n = runs.rows();
  const Index t = runs.cols();
  const Index d = parameters.cols();
  if (n < 2 || parameters.rows() != n || error_sd.size() != t) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a prediction from ", n, " x ", t, " runs at ", parameters.rows(), " x ", d,
        " parameters with ", error_sd.size(),
        " errors: two runs or more, a row of parameters for each and an error for each quantity "
        "are needed."));
  }
  if (!parameters.allFinite() || !runs.allFinite() || !error_sd.allFinite() ||
      (error_sd.array() < 0).any()) {
    return absl::InvalidArgumentError(
        "a prediction's parameters, runs and errors have to be finite, errors not negative.");
  }
  QuantityPrediction result;
  result.mean = runs.colwise().mean();
  const Eigen::MatrixXd departure = runs.rowwise() - result.mean.transpose();
  const Eigen::ArrayXd variance =
      departure.colwise().squaredNorm().transpose().array() / static_cast<double>(n - 1);
  result.separated = !scatters || n >= d + kMoreThanParameters;
  result.sd = (variance + error_sd.array().square()).sqrt();
  result.sd_parameters = result.sd_model = Eigen::VectorXd::Constant(t, kNone);
  // Too few to tell the parts apart: one normal law about their mean.
  result.conditional_mean = result.mean.transpose().replicate(n, 1);
  result.conditional_sd = result.sd;
  result.freedom = static_cast<double>(n - 1);
  if (!scatters) {
    result.sd_parameters = variance.sqrt();
    result.sd_model.setZero();
    result.conditional_mean = runs;
    result.conditional_sd = error_sd;
  } else if (result.separated) {
    const Eigen::MatrixXd centred = parameters.rowwise() - parameters.colwise().mean();
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> regression(centred);
    const Eigen::MatrixXd fitted = centred * Solved(regression, departure);
    const auto rank = static_cast<double>(regression.rank());
    const Eigen::ArrayXd scatter =
        (departure - fitted).colwise().squaredNorm().transpose().array() /
        (static_cast<double>(n - 1) - rank);
    const Eigen::ArrayXd raw =
        fitted.colwise().squaredNorm().transpose().array() / static_cast<double>(n - 1);
    const Eigen::ArrayXd own = (raw - scatter * rank / static_cast<double>(n - 1)).max(0);
    result.freedom = static_cast<double>(n - 1) - rank;
    result.sd_parameters = own.sqrt();
    result.sd_model = scatter.sqrt();
    result.sd = (own + scatter + error_sd.array().square()).sqrt();
    result.conditional_sd = (scatter + error_sd.array().square()).sqrt();
    const Eigen::VectorXd shrink = (raw > 0).select(own / raw.max(kTinySpread), 0.0).sqrt();
    result.conditional_mean = (fitted * shrink.asDiagonal()).rowwise() + result.mean.transpose();
  }
  SetQuantiles(result);
  return result;
}

QuantityPrediction WithModelError(QuantityPrediction prediction, const Eigen::VectorXd& sd) {
  for (Eigen::VectorXd* own : {&prediction.sd, &prediction.sd_model, &prediction.conditional_sd}) {
    *own = (own->array().square() + sd.array().square()).sqrt();
  }
  SetQuantiles(prediction);
  return prediction;
}

Eigen::VectorXd ExceedanceProbability(const QuantityPrediction& prediction, double level) {
  Eigen::VectorXd probability(prediction.mean.size());
  for (Index k = 0; k < probability.size(); ++k) {
    probability[k] = StretchedExceeds(prediction, k, level);
  }
  return probability;
}

Eigen::VectorXd QuantileOf(const QuantityPrediction& prediction, double p) {
  Eigen::VectorXd quantile(prediction.mean.size());
  for (Index k = 0; k < quantile.size(); ++k) {
    quantile[k] =
        p == 0.5 ? prediction.q50[k] : StretchedQuantile(prediction, k, p, prediction.q50[k]);
  }
  return quantile;
}

ExceedanceParts PartsOfExceedance(const QuantityPrediction& prediction, double level) {
  const Index t = prediction.mean.size();
  ExceedanceParts parts{.parameters = Eigen::VectorXd::Constant(t, kNone),
                        .model = Eigen::VectorXd::Constant(t, kNone)};
  if (!prediction.separated) return parts;
  for (Index k = 0; k < t; ++k) {
    const auto reaches = (prediction.conditional_mean.col(k).array() >= level).count();
    parts.parameters[k] =
        static_cast<double>(reaches) / static_cast<double>(prediction.conditional_mean.rows());
    const double sd = prediction.sd_model[k];
    parts.model[k] = sd > 0 ? 0.5 * std::erfc((level - prediction.mean[k]) / (sd * std::sqrt(2.0)))
                            : (prediction.mean[k] >= level ? 1.0 : 0.0);
  }
  return parts;
}

double ExceedanceAnywhere(const QuantityPrediction& prediction, const Eigen::MatrixXd& runs,
                          const Eigen::VectorXd& shared_sd, const Eigen::VectorXd& error_sd,
                          double level) {
  const double stretch = StudentRatio(prediction.freedom) * MeanStretch(prediction);
  std::vector<double> shared(kShares);
  for (int k = 0; k < kShares; ++k)
    shared[static_cast<std::size_t>(k)] = NormalQuantile((k + 0.5) / kShares);
  double sum = 0;
  for (Index i = 0; i < runs.rows(); ++i) {
    const Eigen::VectorXd history =
        prediction.mean + stretch * (runs.row(i).transpose() - prediction.mean);
    for (const double off : shared) {
      double below = 1;
      for (Index t = 0; t < history.size() && below > 0; ++t) {
        const double gap = level - history[t] - off * shared_sd[t];
        below *= error_sd[t] > 0 ? 0.5 * std::erfc(-gap / (error_sd[t] * std::sqrt(2.0)))
                                 : (gap > 0 ? 1.0 : 0.0);
      }
      sum += 1 - below;
    }
  }
  const double share = sum / static_cast<double>(kShares * runs.rows());
  return std::max(share, ExceedanceProbability(prediction, level).maxCoeff());
}

}  // namespace calib::inference
