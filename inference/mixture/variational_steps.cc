#include "inference/mixture/variational_steps.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>

#include "inference/numerics/decompositions.h"
#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

double LogBeta(double a, double b) { return LogGamma(a) + LogGamma(b) - LogGamma(a + b); }

// sum_{i<d} f((nu - i) / 2), the multivariate digamma and log gamma without their constants.
template <typename Function>
double SumOverDimensions(double degrees_of_freedom, Eigen::Index d, Function function) {
  double sum = 0;
  for (Eigen::Index i = 0; i < d; ++i)
    sum += function(0.5 * (degrees_of_freedom - static_cast<double>(i)));
  return sum;
}

Eigen::MatrixXd LowerFactor(const Eigen::MatrixXd& matrix) {
  const Eigen::LLT<Eigen::MatrixXd> factor(matrix);
  assert(factor.info() == Eigen::Success);
  return factor.matrixL();
}

double LogDeterminantOfFactor(const Eigen::MatrixXd& lower) {
  double sum = 0;
  for (Eigen::Index i = 0; i < lower.rows(); ++i) sum += std::log(lower(i, i));
  return sum;
}

// ln |W_k| from C_k = W_k^-1 / nu_k.
double LogDeterminantOfScale(const MixtureState& state, const CovarianceFactors& factors,
                             Eigen::Index k) {
  return -factors.log_determinant[k] -
         static_cast<double>(state.means.rows()) * std::log(state.degrees_of_freedom[k]);
}

// E ln |L_k|                                                              [Bishop 2006, Eq. 10.65]
double ExpectedLogPrecision(const MixtureState& state, const CovarianceFactors& factors,
                            Eigen::Index k) {
  const Eigen::Index d = state.means.rows();
  return SumOverDimensions(state.degrees_of_freedom[k], d, Digamma) +
         static_cast<double>(d) * std::numbers::ln2 + LogDeterminantOfScale(state, factors, k);
}

// E ln pi_k = E ln v_k + sum_{l<k} E ln (1 - v_l).
Eigen::VectorXd ExpectedLogWeights(const MixtureState& state) {
  Eigen::VectorXd result(state.size());
  double rest = 0;
  for (Eigen::Index k = 0; k < state.size(); ++k) {
    const double sum = Digamma(state.a[k] + state.b[k]);
    result[k] = Digamma(state.a[k]) - sum + rest;
    rest += Digamma(state.b[k]) - sum;
  }
  return result;
}

}  // namespace

MixturePrior EmpiricalPrior(const WeightedPoints& data, double concentration,
                            double covariance_floor) {
  const Eigen::Index d = data.points.rows();
  const Eigen::Index n = data.points.cols();
  double total = 0;
  for (const double count : data.counts) total += count;
  assert(total > 1);
  MixturePrior prior{.concentration = concentration,
                     .mean_precision = 1,
                     .degrees_of_freedom = static_cast<double>(d),
                     .mean = Eigen::VectorXd::Zero(d),
                     .inverse_scale = Eigen::MatrixXd::Zero(d, d),
                     .covariance_floor = covariance_floor};
  for (Eigen::Index i = 0; i < n; ++i) prior.mean += data.counts[i] * data.points.col(i);
  prior.mean /= total;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd difference = data.points.col(i) - prior.mean;
    prior.inverse_scale += data.counts[i] * difference * difference.transpose();
  }
  prior.inverse_scale /= total - 1;
  return prior;
}

Eigen::VectorXd MixtureState::Weights() const {
  Eigen::VectorXd weights(size());
  double rest = 1;
  double total = 0;
  for (Eigen::Index k = 0; k < size(); ++k) {
    const double sum = a[k] + b[k];
    weights[k] = a[k] / sum * rest;
    rest *= b[k] / sum;
    total += weights[k];
  }
  return weights / total;
}

Eigen::MatrixXd QuadraticFeatures(const Eigen::MatrixXd& points, const Eigen::VectorXd& origin) {
  const Eigen::Index d = points.rows();
  const Eigen::MatrixXd centred = (points.colwise() - origin).transpose();
  Eigen::MatrixXd features(points.cols(), 1 + d + d * (d + 1) / 2);
  features.col(0).setOnes();
  features.middleCols(1, d) = centred;
  Eigen::Index column = 1 + d;
  for (Eigen::Index l = 0; l < d; ++l) {
    for (Eigen::Index j = l; j < d; ++j)
      features.col(column++) = centred.col(j).cwiseProduct(centred.col(l));
  }
  return features;
}

CovarianceFactors FactorsOf(const MixtureState& state) {
  CovarianceFactors factors{.lower = {}, .log_determinant = Eigen::VectorXd(state.size())};
  for (Eigen::Index k = 0; k < state.size(); ++k) {
    factors.lower.push_back(LowerFactor(state.covariances[k]));
    factors.log_determinant[k] = 2 * LogDeterminantOfFactor(factors.lower.back());
  }
  return factors;
}

Eigen::MatrixXd LogDensityCoefficients(const MixtureState& state, const CovarianceFactors& factors,
                                       const Eigen::VectorXd& origin) {
  const Eigen::Index d = state.means.rows();
  const auto dimensions = static_cast<double>(d);
  const Eigen::VectorXd log_weights = ExpectedLogWeights(state);
  Eigen::MatrixXd coefficients(1 + d + d * (d + 1) / 2, state.size());
  Eigen::MatrixXd precision(d, d);
  Eigen::VectorXd pulled(d);
  for (Eigen::Index k = 0; k < state.size(); ++k) {
    // E ln N = (E ln|L| - d/beta - nu (x - m)^T W (x - m) - d ln 2 pi) / 2
    //                                                                    [Bishop 2006, Eq. 10.64]
    const auto lower = factors.lower[k].triangularView<Eigen::Lower>();
    precision.setIdentity();
    lower.solveInPlace(precision);
    lower.transpose().solveInPlace(precision);
    const Eigen::VectorXd mean = state.means.col(k) - origin;
    pulled.noalias() = precision.lazyProduct(mean);
    coefficients(0, k) =
        log_weights[k] +
        0.5 * (ExpectedLogPrecision(state, factors, k) - dimensions / state.mean_precision[k] -
               dimensions * std::log(2 * std::numbers::pi) - mean.dot(pulled));
    coefficients.col(k).segment(1, d) = pulled;
    Eigen::Index row = 1 + d;
    for (Eigen::Index l = 0; l < d; ++l) {
      for (Eigen::Index j = l; j < d; ++j)
        coefficients(row++, k) = (j == l ? -0.5 : -1.0) * precision(j, l);
    }
  }
  return coefficients;
}

Expectation EStep(const Eigen::MatrixXd& points, const MixtureState& state) {
  const Eigen::VectorXd origin = state.means.rowwise().mean();
  const Eigen::MatrixXd log_rho =
      QuadraticFeatures(points, origin) * LogDensityCoefficients(state, FactorsOf(state), origin);
  const Eigen::VectorXd largest = log_rho.rowwise().maxCoeff();
  Expectation expectation;
  expectation.responsibilities = (log_rho.colwise() - largest).array().exp();
  const Eigen::VectorXd sum = expectation.responsibilities.rowwise().sum();
  expectation.log_density = largest.array() + sum.array().log();
  expectation.responsibilities.array().colwise() /= sum.array();
  return expectation;
}

MixtureState MStep(const MixturePrior& prior, const Eigen::MatrixXd& moments) {
  const Eigen::Index d = prior.mean.size();
  const Eigen::Index components = moments.cols();
  MixtureState state{.a = Eigen::VectorXd(components),
                     .b = Eigen::VectorXd(components),
                     .mean_precision = Eigen::VectorXd(components),
                     .degrees_of_freedom = Eigen::VectorXd(components),
                     .means = Eigen::MatrixXd(d, components),
                     .covariances = std::vector<Eigen::MatrixXd>(components)};
  const Eigen::VectorXd size =
      moments.row(0).transpose().array() + 10 * std::numeric_limits<double>::epsilon();
  for (Eigen::Index k = 0; k < components; ++k) {
    const Eigen::VectorXd about = moments.col(k).segment(1, d) / size[k];  // the prior's mean
    Eigen::MatrixXd& covariance = state.covariances[k];
    covariance.resize(d, d);
    state.mean_precision[k] = prior.mean_precision + size[k];
    state.degrees_of_freedom[k] = prior.degrees_of_freedom + size[k];
    state.means.col(k) = prior.mean + size[k] / state.mean_precision[k] * about;
    const double pull = size[k] * prior.mean_precision / state.mean_precision[k];
    const double share = 1 / state.degrees_of_freedom[k];
    Eigen::Index row = 1 + d;
    for (Eigen::Index l = 0; l < d; ++l) {
      for (Eigen::Index j = l; j < d; ++j) {
        // N_k S_k about the mean: sum r x x^T - N m m^T; a variance that rounding leaves negative
        // is none.
        const double product = about[j] * about[l];
        double scatter = moments(row++, k) - moments(0, k) * product;
        if (j == l) scatter = std::max(scatter, 0.0) + size[k] * prior.covariance_floor;
        covariance(j, l) = covariance(l, j) =
            share * (scatter + prior.inverse_scale(j, l) + pull * product);
      }
    }
  }
  double later = 0;
  for (Eigen::Index k = components - 1; k >= 0; --k) {
    state.a[k] = 1 + size[k];
    state.b[k] = prior.concentration + later;
    later += size[k];
  }
  return state;
}

double IterationBound(const MixtureState& state, const CovarianceFactors& factors, double entropy) {
  const Eigen::Index d = state.means.rows();
  const auto dimensions = static_cast<double>(d);
  double bound = entropy;
  for (Eigen::Index k = 0; k < state.size(); ++k) {
    const double nu = state.degrees_of_freedom[k];
    bound +=
        0.5 * nu * (LogDeterminantOfScale(state, factors, k) + dimensions * std::numbers::ln2) +
        SumOverDimensions(nu, d, LogGamma);
    bound += LogBeta(state.a[k], state.b[k]) - 0.5 * dimensions * std::log(state.mean_precision[k]);
  }
  return bound;
}

double EvidenceLowerBound(const WeightedPoints& data, const MixturePrior& prior,
                          const MixtureState& state) {
  const Eigen::Index d = state.means.rows();
  const auto dimensions = static_cast<double>(d);
  const Expectation expectation = EStep(data.points, state);
  double bound = 0;
  for (Eigen::Index i = 0; i < data.points.cols(); ++i)
    bound += data.counts[i] * expectation.log_density[i];
  const double nu0 = prior.degrees_of_freedom;
  const Eigen::MatrixXd factor0 = LowerFactor(prior.inverse_scale);
  const double log_scale0 = -2 * LogDeterminantOfFactor(factor0);
  const CovarianceFactors factors = FactorsOf(state);
  for (Eigen::Index k = 0; k < state.size(); ++k) {
    const double a = state.a[k];
    const double b = state.b[k];
    const double kl_beta = LogBeta(1, prior.concentration) - LogBeta(a, b) + (a - 1) * Digamma(a) +
                           (b - prior.concentration) * Digamma(b) +
                           (1 - a + prior.concentration - b) * Digamma(a + b);
    const double nu = state.degrees_of_freedom[k];
    const double beta_ratio = prior.mean_precision / state.mean_precision[k];
    const auto lower = factors.lower[k].triangularView<Eigen::Lower>();
    // nu W = C^-1, so quadratic forms of W come from C.
    const double pull = lower.solve(state.means.col(k) - prior.mean).squaredNorm();
    const double kl_mean = 0.5 * (-dimensions * std::log(beta_ratio) + dimensions * beta_ratio +
                                  prior.mean_precision * pull - dimensions);
    const double trace = lower.solve(factor0).squaredNorm();  // nu tr(W0^-1 W)
    const double kl_wishart = 0.5 * (nu0 * (log_scale0 - LogDeterminantOfScale(state, factors, k)) +
                                     trace - nu * dimensions) +
                              SumOverDimensions(nu0, d, LogGamma) -
                              SumOverDimensions(nu, d, LogGamma) +
                              0.5 * (nu - nu0) * SumOverDimensions(nu, d, Digamma);
    bound -= kl_beta + kl_mean + kl_wishart;
  }
  return bound;
}

}  // namespace calib::inference
