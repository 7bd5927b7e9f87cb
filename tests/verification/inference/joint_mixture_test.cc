// Proposals from a mixture of parameters joint with states: what they change is where samples are
// drawn, never the posterior.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iomanip>
#include <iostream>
#include <string>
#include <vector>

#include "tests/verification/inference/hyperbolic_curve.h"
#include "tests/verification/inference/linear_model.h"
#include "tests/verification/inference/toy_curve.h"

namespace calib::inference {
namespace {

constexpr MixtureOver kBoth[] = {MixtureOver::kParameters, MixtureOver::kParametersAndStates};

// A linear model whose readings are taken twice, with the same result. A run takes one of two
// branches, above the first readings and below the second ones by the same distance or the other
// way round, as its parameters lie on one side of a plane or the other: no branch fits better, so
// that posterior and evidence are those of the linear model, the evidence less e^(-distance^2) per
// pair.
struct BranchedModel {
  static constexpr double kDistance = 0.7;  // standard deviations of a reading
  LinearModel linear{5, 2, 1.0, 11};

  BranchedModel() {
    linear.design = linear.design.replicate(2, 1).eval();
    linear.values = linear.values.replicate(2, 1).eval();
    linear.sd = linear.sd.replicate(2, 1).eval();
  }

  Eigen::MatrixXd Predict(const Eigen::MatrixXd& parameters) const {
    Eigen::MatrixXd predictions = linear.Predict(parameters);
    const Eigen::Index pairs = linear.values.size() / 2;
    const Eigen::VectorXd centre = linear.PosteriorMean();
    for (Eigen::Index i = 0; i < parameters.rows(); ++i) {
      const double side = parameters(i, 0) - parameters(i, 1) < centre[0] - centre[1] ? -1 : 1;
      const Eigen::RowVectorXd step = side * kDistance * linear.sd.head(pairs).transpose();
      predictions.row(i).head(pairs) += step;
      predictions.row(i).tail(pairs) -= step;
    }
    return predictions;
  }

  double LogEvidence() const {
    return linear.LogEvidence() -
           0.5 * static_cast<double>(linear.values.size()) * kDistance * kDistance;
  }
};

double LargestShare(const Proposal& proposal) {
  double largest = 0;
  for (const MixtureComponent& component : proposal.components)
    largest = std::max(largest, component.weight);
  return largest;
}

// Four standard errors of as many effective draws of a normal: of a mean 1 / sqrt(n), of an sd
// 1 / sqrt(2 n).
TEST(JointMixture, PosteriorAndEvidenceOfALinearModelWhateverTheMixture) {
  const BranchedModel model;
  const Eigen::VectorXd mean = model.linear.PosteriorMean();
  const Eigen::VectorXd sd = model.linear.PosteriorCovariance().diagonal().cwiseSqrt();
  std::vector<Proposal> proposals;
  for (const MixtureOver over : kBoth) {
    const FilterOptions options{.mixture = over, .seed = 5};
    const auto iterations =
        RunIterations(model.linear.priors, model.linear.Data(), options, 3, 1000,
                      [&](const Eigen::MatrixXd& p) { return model.Predict(p); });
    proposals.push_back(iterations[1].proposal);
    const auto posterior =
        ComputePosterior(model.linear.priors, model.linear.Data(), options, iterations);
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    EXPECT_EQ(posterior->degeneracy, "");
    for (Eigen::Index j = 0; j < 2; ++j) {
      const ParameterSummary& parameter = posterior->parameters[static_cast<std::size_t>(j)];
      EXPECT_NEAR(parameter.mean, mean[j], 4 * sd[j] / std::sqrt(posterior->ess));
      EXPECT_NEAR(parameter.sd, sd[j], 4 * sd[j] / std::sqrt(2 * posterior->ess));
    }
    EXPECT_NEAR(posterior->log_evidence, model.LogEvidence(), 4 * posterior->log_evidence_se);
  }
  // The branches are seen: two sides at least, where the parameters alone make one lump.
  EXPECT_LT(LargestShare(proposals[1]), 0.7);
  EXPECT_GT(LargestShare(proposals[0]), 0.9);
}

// Its density integrates to one within the prior: the mean of proposal / prior over prior draws.
TEST(JointMixture, ProposalIsNormalised) {
  const std::vector<Prior> priors{{.kind = PriorKind::kLogUniform, .min = 1, .max = 100},
                                  {.kind = PriorKind::kUniform, .min = -1, .max = 1}};
  DataSet data;
  data.readings.push_back({.load_step = 0, .value = 2.0, .sd = 2});
  data.readings.push_back({.load_step = 1, .value = 0.9, .sd = 0.3});
  data.readings.push_back({.load_step = 2, .value = 3.0, .sd = 2});
  const FilterOptions options{
      .mixture = MixtureOver::kParametersAndStates, .design = Design::kSobol, .seed = 8};
  const auto iterations =
      RunIterations(priors, data, options, 2, 500, [](const Eigen::MatrixXd& p) {
        Eigen::MatrixXd states(p.rows(), 3);
        states << p, p.col(0).cwiseProduct(p.col(1));
        return states;
      });
  const Proposal& proposal = iterations[1].proposal;
  ASSERT_LT(proposal.log_acceptance, -0.1) << "the mixture should overlap the bounds";
  const Eigen::MatrixXd points = DrawSamples({}, priors, options, 0, 1 << 15).value();
  const Eigen::VectorXd ratio =
      (LogDensity(proposal, priors, points) - LogDensity({}, priors, points)).array().exp();
  EXPECT_NEAR(ratio.mean(), 1, 0.003);
}

struct Case {
  std::string name;
  JointPrior priors;
  DataSet data;
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)> predict;
};

// A stand-in for DEM runs, measured at the median of its priors. The scatter of a run belongs to
// its packing, another one for every sample.
template <typename Model>
Case CurveCase(const std::string& name, const Model& model, double noise, std::uint64_t seed) {
  Eigen::VectorXd truth(model.d);
  for (int j = 0; j < model.d; ++j)
    truth[j] = model.Priors()[static_cast<std::size_t>(j)].Quantile(0.5);
  return {.name = name,
          .priors = model.Priors(),
          .data = model.Measure(truth, noise, seed),
          .predict = [model, seed](const Eigen::MatrixXd& p) {
            Eigen::MatrixXd predictions(p.rows(), model.readings);
            for (Eigen::Index i = 0; i < p.rows(); ++i)
              predictions.row(i) = model.Run(p.row(i), seed, static_cast<std::uint64_t>(i));
            return predictions;
          }};
}

std::vector<Case> Cases(std::uint64_t seed) {
  const LinearModel linear(20, 4, 0.3, seed);
  const BranchedModel branched;
  const std::vector<Prior> square(2, {.kind = PriorKind::kUniform, .min = -3, .max = 3});
  DataSet ridge;  // x and y + x^2 - 2, of which the first is hardly known: a bent ridge
  ridge.readings.push_back({.load_step = 0, .value = 0, .sd = 1.5});
  ridge.readings.push_back({.load_step = 1, .value = 0, .sd = 0.3});
  DataSet ring;  // x^2 + y^2 = 4
  ring.readings.push_back({.value = 4, .sd = 0.5});
  return {
      {"linear", linear.priors, linear.Data(),
       [linear](const Eigen::MatrixXd& p) { return linear.Predict(p); }},
      {"two branches", branched.linear.priors, branched.linear.Data(),
       [branched](const Eigen::MatrixXd& p) { return branched.Predict(p); }},
      {"bent ridge", square, ridge,
       [](const Eigen::MatrixXd& p) {
         Eigen::MatrixXd states = p;
         states.col(1).array() += p.col(0).array().square() - 2;
         return states;
       }},
      {"ring", square, ring,
       [](const Eigen::MatrixXd& p) { return Eigen::MatrixXd(p.rowwise().squaredNorm()); }},
      CurveCase("hyperbolic curve", HyperbolicCurve{}, 0.05, seed),
      CurveCase("softening curve", ToyCurve{}, 0.05, seed),
  };
}

int Seeds() {
  const char* text = std::getenv("CALIB_SEEDS");
  return text != nullptr ? std::max(2, std::atoi(text)) : 10;
}

// Effective samples of a posterior from two iterations of 200 samples (README.md of the filter).
TEST(JointMixture, EffectiveSamplesOfTheSecondIteration) {
  std::vector<std::string> names;
  std::vector<double> log_ess[2];
  for (int seed = 1; seed <= Seeds(); ++seed) {
    const auto cases = Cases(static_cast<std::uint64_t>(seed));
    for (std::size_t c = 0; c < cases.size(); ++c) {
      if (names.size() <= c) names.push_back(cases[c].name);
      for (int k = 0; k < 2; ++k) {
        const FilterOptions options{.mixture = kBoth[k], .seed = static_cast<std::uint64_t>(seed)};
        const auto iterations =
            RunIterations(cases[c].priors, cases[c].data, options, 2, 200, cases[c].predict);
        const auto posterior =
            ComputePosterior(cases[c].priors, cases[c].data, options, iterations);
        ASSERT_TRUE(posterior.ok()) << posterior.status();
        log_ess[k].resize(cases.size());
        log_ess[k][c] += std::log(posterior->ess) / Seeds();
      }
    }
  }
  std::cout << "effective samples, geometric mean of " << Seeds()
            << " seeds: parameters, parameters and states\n";
  for (std::size_t c = 0; c < names.size(); ++c) {
    std::cout << std::setw(20) << names[c] << std::fixed << std::setprecision(1) << std::setw(8)
              << std::exp(log_ess[0][c]) << std::setw(8) << std::exp(log_ess[1][c]) << "\n";
    EXPECT_NEAR(log_ess[1][c], log_ess[0][c], std::log(1.5)) << names[c];
  }
}

}  // namespace
}  // namespace calib::inference
