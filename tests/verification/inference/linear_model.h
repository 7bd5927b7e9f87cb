#pragma once
// A model with known answers: y = A theta + e, e ~ N(0, diag sd^2),
// theta ~ N(prior mean, diag prior sd^2).

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <vector>

#include "inference/filter/iterative_filter.h"
#include "inference/sampling/philox.h"

namespace calib::inference {

struct LinearModel {
  Eigen::MatrixXd design;  // T x d
  Eigen::VectorXd values, sd;
  std::vector<Prior> priors;

  // T readings from d parameters with given noise; the truth is one draw of the prior.
  LinearModel(int readings, int parameters, double noise, std::uint64_t seed) {
    PhiloxStream stream({.seed = seed});
    design = Eigen::MatrixXd::NullaryExpr(readings, parameters, [&] { return stream.Normal(); });
    sd = Eigen::VectorXd::NullaryExpr(readings, [&] { return noise * (0.5 + stream.Uniform()); });
    Eigen::VectorXd truth(parameters);
    for (double& value : truth) {
      priors.push_back(
          {.kind = PriorKind::kNormal, .mean = stream.Normal(), .sd = 0.5 + stream.Uniform()});
      value = priors.back().mean + priors.back().sd * stream.Normal();
    }
    values = design * truth;
    for (Eigen::Index t = 0; t < readings; ++t) values[t] += sd[t] * stream.Normal();
  }

  DataSet Data() const {
    DataSet data;
    for (Eigen::Index t = 0; t < values.size(); ++t) {
      data.readings.push_back({.load_step = static_cast<int>(t), .value = values[t], .sd = sd[t]});
    }
    return data;
  }

  Eigen::MatrixXd Predict(const Eigen::MatrixXd& parameters) const {
    return parameters * design.transpose();
  }

  Eigen::MatrixXd PosteriorCovariance() const {
    Eigen::MatrixXd precision =
        design.transpose() * sd.array().square().inverse().matrix().asDiagonal() * design;
    for (Eigen::Index j = 0; j < precision.rows(); ++j)
      precision(j, j) += 1 / (priors[j].sd * priors[j].sd);
    return precision.inverse();
  }

  Eigen::VectorXd PosteriorMean() const {
    Eigen::VectorXd right = design.transpose() * (values.array() / sd.array().square()).matrix();
    for (Eigen::Index j = 0; j < right.size(); ++j)
      right[j] += priors[j].mean / (priors[j].sd * priors[j].sd);
    return PosteriorCovariance() * right;
  }

  // y ~ N(A m, A S A^T + diag sd^2).
  double LogEvidence() const {
    Eigen::VectorXd mean(design.cols());
    Eigen::VectorXd variance(design.cols());
    for (Eigen::Index j = 0; j < mean.size(); ++j) {
      mean[j] = priors[j].mean;
      variance[j] = priors[j].sd * priors[j].sd;
    }
    Eigen::MatrixXd covariance = design * variance.asDiagonal() * design.transpose();
    covariance.diagonal().array() += sd.array().square();
    const Eigen::LDLT<Eigen::MatrixXd> factor(covariance);
    const Eigen::VectorXd residual = values - design * mean;
    return -0.5 * (residual.dot(factor.solve(residual)) + factor.vectorD().array().log().sum() +
                   static_cast<double>(values.size()) * std::log(2 * std::numbers::pi));
  }
};

// `count` iterations of n samples of a model that is a function of one row of parameters.
template <typename Predict>
std::vector<Iteration> RunIterations(const JointPrior& priors, const DataSet& data,
                                     const FilterOptions& options, int count, int n,
                                     const Predict& predict) {
  std::vector<Iteration> iterations;
  for (int k = 0; k < count; ++k) {
    Iteration iteration;
    if (k > 0) iteration.proposal = FitProposal(priors, data, options, iterations).value();
    iteration.parameters = DrawSamples(iteration.proposal, priors, options, k, n).value();
    iteration.predictions = predict(iteration.parameters);
    iterations.push_back(std::move(iteration));
  }
  return iterations;
}

}  // namespace calib::inference
