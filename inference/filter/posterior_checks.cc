#include "inference/filter/posterior_checks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/numerics/log_weights.h"
#include "inference/numerics/special_functions.h"
#include "inference/sampling/halton.h"

namespace calib::inference {
namespace {

constexpr int kDrawsOfFactor = 2000;  // of a factor; chosen: its 5 % quantile is known to 0.5 %
constexpr double kNoWeight = 1e-12;   // of a sample, that no digit of a probability shows; chosen

}  // namespace

Eigen::MatrixXd NoiseScale(const GaussianLikelihood::FactorPosterior& factors,
                           const Eigen::VectorXd& log_weights) {
  Eigen::MatrixXd scale(factors.shapes.size(), 3);
  std::vector<double> draws(kDrawsOfFactor);
  for (Eigen::Index g = 0; g < scale.rows(); ++g) {
    Eigen::Index i = 0;  // the last sample of positive weight passed
    Eigen::Index next = 0;
    double passed = 0;
    for (int m = 0; m < kDrawsOfFactor; ++m) {
      for (; passed < (m + 0.5) / kDrawsOfFactor && next < log_weights.size(); ++next) {
        const double weight = std::exp(log_weights[next]);
        if (weight > 0) i = next;
        passed += weight;
      }
      const double u = RadicalInverse(static_cast<std::uint64_t>(m) + 1, 2);
      draws[static_cast<std::size_t>(m)] =
          std::sqrt(factors.rates(i, g) / GammaQInverse(factors.shapes[g], u));
    }
    std::sort(draws.begin(), draws.end());
    scale.row(g) << draws[kDrawsOfFactor / 20], draws[kDrawsOfFactor / 2],
        draws[kDrawsOfFactor - 1 - kDrawsOfFactor / 20];
  }
  return scale;
}

std::vector<ModelErrorSummary> ModelErrorsOver(const GaussianLikelihood& likelihood,
                                               const DataSet& data,
                                               const Eigen::MatrixXd& predictions,
                                               const Eigen::VectorXd& log_weights) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < log_weights.size(); ++i) {
    if (log_weights[i] >= std::log(kNoWeight)) rows.push_back(i);
  }
  std::vector<ModelErrorSummary> summaries;
  for (const auto& levels : likelihood.ModelErrors(predictions(rows, Eigen::all))) {
    Eigen::VectorXd probability = Eigen::VectorXd::Zero(levels.log_joint.cols());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const Eigen::VectorXd of_sample =
          NormalizedLogWeights(levels.log_joint.row(static_cast<Eigen::Index>(i)));
      probability += std::exp(log_weights[rows[i]]) * of_sample.array().exp().matrix();
    }
    summaries.push_back(SummarizeModelError(data.model_errors[levels.error], levels.cells,
                                            probability / probability.sum()));
  }
  return summaries;
}

// ln L = const - chi^2 / 2 with stated errors, the constant that of zero residuals.
double PredictiveP(const DataSet& data, const Eigen::VectorXd& log_likelihood,
                   const Eigen::VectorXd& log_weights, const KnownFrom& known) {
  const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kGiven);
  const bool few = std::isfinite(known.Freedom());
  double p = 0;
  if (!likelihood.ok()) return std::numeric_limits<double>::quiet_NaN();
  const auto readings = static_cast<Eigen::Index>(data.readings.size());
  const double perfect = likelihood->LogLikelihoodBound(
      Eigen::MatrixXd::Constant(1, readings, std::numeric_limits<double>::quiet_NaN()))[0];
  for (Eigen::Index i = 0; i < log_weights.size(); ++i) {
    const double weight = std::exp(log_weights[i]);
    if (weight < kNoWeight) continue;
    const double half = std::max(0.0, perfect - log_likelihood[i]);
    p += weight * (few ? UpperTail(2 * half, static_cast<double>(readings), known)
                       : GammaQInDouble(0.5 * static_cast<double>(readings), half));
  }
  return p;
}

Eigen::VectorXd HalvesDiffer(const Eigen::MatrixXd& samples, const Eigen::VectorXd& log_weights,
                             const std::vector<int>& halves,
                             std::span<const ParameterSummary> parameters) {
  const Eigen::Index d = samples.cols();
  double mass[2] = {0, 0};
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(2, d);
  for (Eigen::Index i = 0; i < log_weights.size(); ++i) {
    const double weight = std::exp(log_weights[i]);
    const int own = halves[static_cast<std::size_t>(i)];
    mass[own] += weight;
    for (Eigen::Index j = 0; j < d; ++j) {
      sums(own, j) += weight * (samples(i, j) - parameters[static_cast<std::size_t>(j)].mean);
    }
  }
  Eigen::VectorXd difference(d);
  for (Eigen::Index j = 0; j < d; ++j) {
    difference[j] = std::abs(sums(0, j) / mass[0] - sums(1, j) / mass[1]) /
                    parameters[static_cast<std::size_t>(j)].sd;
  }
  return difference;
}

}  // namespace calib::inference
