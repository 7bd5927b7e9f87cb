// Evidence by importance sampling on two modes whose masses are known.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

// y = |theta|, so that two equal modes share the posterior; a mixture has to find both.
TEST(Evidence, TwoModesKeepTheirMasses) {
  const std::vector<Prior> priors{{.kind = PriorKind::kUniform, .min = -4, .max = 4},
                                  {.kind = PriorKind::kUniform, .min = -4, .max = 4}};
  DataSet data;
  data.readings.push_back({.load_step = 0, .value = 2, .sd = 0.2});
  data.readings.push_back({.load_step = 1, .value = 1, .sd = 0.3});
  const auto predict = [](const Eigen::MatrixXd& p) {
    Eigen::MatrixXd predictions = p;
    predictions.col(0) = p.col(0).cwiseAbs();
    return predictions;
  };
  // p(y) = 2 / 64: each Gaussian lies inside the box.
  const double exact = std::log(2.0 / 64.0);
  double mean_error = 0;
  double variance = 0;  // of it, from the standard errors stated
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const FilterOptions options{.design = Design::kSobol, .seed = seed};
    const auto iterations = RunIterations(priors, data, options, 3, 400, predict);
    const auto posterior = ComputePosterior(priors, data, options, iterations);
    EXPECT_NEAR(posterior->log_evidence, exact, 4 * posterior->log_evidence_se);
    mean_error += (posterior->log_evidence - exact) / 5;
    variance += std::pow(posterior->log_evidence_se, 2) / 25;
    double right = 0;
    Eigen::Index row = 0;
    for (const Iteration& iteration : iterations) {
      for (Eigen::Index i = 0; i < iteration.parameters.rows(); ++i, ++row) {
        if (iteration.parameters(i, 0) > 0) right += std::exp(posterior->log_weights[row]);
      }
    }
    EXPECT_NEAR(right, 0.5, 4 * 0.5 / std::sqrt(posterior->ess));  // four standard errors
  }
  EXPECT_LE(std::abs(mean_error), 4 * std::sqrt(variance));
}

}  // namespace
}  // namespace calib::inference
