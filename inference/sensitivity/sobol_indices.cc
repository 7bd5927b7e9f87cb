#include "inference/sensitivity/sobol_indices.h"

#include <cmath>
#include <limits>

#include "inference/sampling/sobol.h"
#include "inference/sensitivity/spread.h"

namespace calib::inference {

using Eigen::Index;

std::vector<Eigen::MatrixXd> SobolSets(int dimensions, const SobolOptions& options) {
  std::vector<Eigen::MatrixXd> sets;
  sets.reserve(static_cast<std::size_t>(options.replicates));
  for (int r = 0; r < options.replicates; ++r) {
    sets.push_back(ScrambledSobol(options.points, 2 * dimensions,
                                  options.seed * 1000 + static_cast<std::uint64_t>(r)));
  }
  return sets;
}

std::vector<SobolIndices> EstimateSobolIndices(std::span<const Eigen::MatrixXd> sets,
                                               const UnitFunction& f) {
  const auto replicates = static_cast<Index>(sets.size());
  const Index d = sets.front().cols() / 2;
  const Index n = sets.front().rows();
  std::vector<Eigen::MatrixXd> first;  // [output]: replicates x d
  std::vector<Eigen::MatrixXd> total;
  Eigen::MatrixXd means;      // replicates x outputs
  Eigen::MatrixXd variances;  // replicates x outputs
  for (Index r = 0; r < replicates; ++r) {
    const Eigen::MatrixXd& both = sets[static_cast<std::size_t>(r)];
    const Eigen::MatrixXd a = both.leftCols(d);
    const Eigen::MatrixXd b = both.rightCols(d);
    const Eigen::MatrixXd at_a = f(a);
    const Eigen::MatrixXd at_b = f(b);
    const Index k = at_a.cols();
    if (r == 0) {
      first.assign(static_cast<std::size_t>(k), Eigen::MatrixXd(replicates, d));
      total = first;
      means.resize(replicates, k);
      variances.resize(replicates, k);
    }
    for (Index o = 0; o < k; ++o) {
      means(r, o) = 0.5 * (at_a.col(o).mean() + at_b.col(o).mean());
      variances(r, o) = ((at_a.col(o).array() - means(r, o)).square().sum() +
                         (at_b.col(o).array() - means(r, o)).square().sum()) /
                        static_cast<double>(2 * n - 1);
    }
    for (Index j = 0; j < d; ++j) {
      Eigen::MatrixXd mixed = a;
      mixed.col(j) = b.col(j);
      const Eigen::MatrixXd at_mixed = f(mixed);
      for (Index o = 0; o < k; ++o) {
        const auto output = static_cast<std::size_t>(o);
        // Outputs about their mean: the product is then free of a term that has none in it.
        first[output](r, j) =
            ((at_b.col(o).array() - means(r, o)) * (at_mixed.col(o) - at_a.col(o)).array()).mean();
        total[output](r, j) = 0.5 * (at_a.col(o) - at_mixed.col(o)).array().square().mean();
      }
    }
  }
  std::vector<SobolIndices> all;
  for (std::size_t o = 0; o < first.size(); ++o) {
    SobolIndices& indices = all.emplace_back();
    const auto column = static_cast<Index>(o);
    indices.mean = means.col(column).mean();
    indices.variance = variances.col(column).mean();
    const double scale = IsRounding(indices.variance, std::abs(indices.mean))
                             ? std::numeric_limits<double>::quiet_NaN()
                             : indices.variance;
    indices.first = first[o].colwise().mean() / scale;
    indices.total = total[o].colwise().mean() / scale;
    indices.first_error = ErrorOfMean(first[o]) / scale;
    indices.total_error = ErrorOfMean(total[o]) / scale;
  }
  return all;
}

}  // namespace calib::inference
