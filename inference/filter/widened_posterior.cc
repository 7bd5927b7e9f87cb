#include "inference/filter/widened_posterior.h"

#include <cmath>
#include <utility>
#include <vector>

#include "inference/filter/parameter_summary.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/scatter/moved_draws.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kDraws = 2000;      // chosen: an sd is then known to 1.6 %
constexpr double kRounding = 1e-9;  // factors below 1 + this widen nothing

// Rows of the iterations, each as often as its weight asks for: the draws at (i + 1/2) / kDraws of
// the summed weight.
struct Draws {
  Eigen::MatrixXd parameters, histories;
};

Draws EquallyWeighted(std::span<const Iteration> iterations, const Eigen::VectorXd& log_weights) {
  Draws draws{.parameters = {kDraws, iterations.front().parameters.cols()},
              .histories = {kDraws, iterations.front().predictions.cols()}};
  Index drawn = 0;
  Index at = 0;
  double sum = 0;
  for (const Iteration& iteration : iterations) {
    for (Index i = 0; i < iteration.parameters.rows(); ++i, ++at) {
      if (!(log_weights[at] > -HUGE_VAL)) continue;
      sum += std::exp(log_weights[at]);
      while (drawn < kDraws && (static_cast<double>(drawn) + 0.5) / kDraws < sum) {
        draws.parameters.row(drawn) = iteration.parameters.row(i);
        draws.histories.row(drawn) = iteration.predictions.row(i);
        ++drawn;
      }
    }
  }
  draws.parameters.conservativeResize(drawn, Eigen::NoChange);
  draws.histories.conservativeResize(drawn, Eigen::NoChange);
  return draws;
}

}  // namespace

double WidenByRefits(const JointPrior& priors, const DataSet& data, const Replicates& replicates,
                     std::span<const Iteration> iterations, std::uint64_t seed,
                     Posterior& posterior) {
  std::vector<Index> free;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    const bool held = j < posterior.frozen.size() && posterior.frozen[j].has_value();
    if (!held) free.push_back(static_cast<Index>(j));
  }
  const Draws draws = EquallyWeighted(iterations, posterior.log_weights);
  const MovedDraws moved =
      MoveByRefits(priors, data, replicates, draws.parameters, draws.histories, free, seed);
  if (!(moved.widened > 1 + kRounding)) return 1;
  const Index n = moved.draws.rows();
  const Eigen::VectorXd equal = Eigen::VectorXd::Constant(n, -std::log(static_cast<double>(n)));
  for (const Index j : free) {
    const auto k = static_cast<std::size_t>(j);
    const double mean = posterior.parameters[k].mean;
    posterior.parameters[k] = Summarize(priors[k], equal, moved.draws.col(j));
    posterior.parameters[k].mean = mean;
    posterior.parameters[k].cov = CoefficientOfVariation(mean, posterior.parameters[k].sd);
  }
  posterior.correlation =
      CorrelationOf(WeightedCovariance(equal, moved.draws, WeightedMean(equal, moved.draws)));
  return moved.widened;
}

}  // namespace calib::inference
