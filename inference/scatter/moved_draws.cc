#include "inference/scatter/moved_draws.h"

#include <algorithm>

#include "inference/numerics/decompositions.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr int kAttempts = 100;  // chosen: a draw that fails so often lies in a corner

Eigen::MatrixXd ToStandard(const JointPrior& priors, const Eigen::MatrixXd& draws,
                           const std::vector<Index>& free) {
  Eigen::MatrixXd standard(draws.rows(), static_cast<Index>(free.size()));
  for (Index k = 0; k < standard.cols(); ++k) {
    const Index j = free[static_cast<std::size_t>(k)];
    for (Index i = 0; i < draws.rows(); ++i) {
      standard(i, k) = priors[static_cast<std::size_t>(j)].ToStandard(draws(i, j));
    }
  }
  return standard;
}

double Deviation(const Eigen::VectorXd& values) {
  return (values.array() - values.mean()).matrix().norm();
}

}  // namespace

MovedDraws MoveByRefits(const JointPrior& priors, const DataSet& data, const Replicates& replicates,
                        const Eigen::MatrixXd& draws, const Eigen::MatrixXd& histories,
                        const std::vector<Index>& free, std::uint64_t seed) {
  MovedDraws result{.draws = draws};
  const Eigen::MatrixXd standard = ToStandard(priors, draws, free);
  const Eigen::MatrixXd spread =
      SpreadOfRefits(standard, histories, ErrorCovariance(data), replicates);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts(spread);
  const Eigen::MatrixXd root =
      parts.eigenvectors() * parts.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  Eigen::VectorXd normal(standard.cols());
  for (Index i = 0; i < draws.rows(); ++i) {
    PhiloxStream stream({.seed = seed,
                         .purpose = StreamPurpose::kRefitSpread,
                         .iteration = 0,
                         .sample = static_cast<std::uint64_t>(i)});
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      for (double& value : normal) value = stream.Normal();
      const Eigen::VectorXd moved = standard.row(i).transpose() + root * normal;
      Eigen::VectorXd point = draws.row(i);
      for (Index k = 0; k < moved.size(); ++k) {
        const Index j = free[static_cast<std::size_t>(k)];
        point[j] = priors[static_cast<std::size_t>(j)].FromStandard(moved[k]);
      }
      if (!priors.InSupport(point)) continue;
      result.draws.row(i) = point;
      break;
    }
  }
  const Eigen::MatrixXd after = ToStandard(priors, result.draws, free);
  for (Index k = 0; k < after.cols(); ++k) {
    const double before = Deviation(standard.col(k));
    if (before > 0) result.widened = std::max(result.widened, Deviation(after.col(k)) / before);
  }
  return result;
}

}  // namespace calib::inference
