#include "inference/diagnosis/stage_projection.h"

#include <algorithm>
#include <cmath>

#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// n x m Legendre polynomials of degree 0 .. m-1 at x.
Eigen::MatrixXd Legendre(const Eigen::VectorXd& x, Index m) {
  Eigen::MatrixXd result(x.size(), m);
  for (Index k = 0; k < m; ++k) {
    if (k == 0) {
      result.col(0).setOnes();
    } else if (k == 1) {
      result.col(1) = x;
    } else {
      const auto g = static_cast<double>(k);
      result.col(k) =
          ((2 * g - 1) * x.cwiseProduct(result.col(k - 1)) - (g - 1) * result.col(k - 2)) / g;
    }
  }
  return result;
}

// Coefficients of one stage as functions of its readings, m x n.
Eigen::MatrixXd ProjectOne(const Eigen::VectorXd& path) {
  const Index n = path.size();
  const Index m = std::min<Index>(4, (n + 1) / 2);
  const double length = path[n - 1] - path[0];
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  if (length > 0) x = 2 * ((path.array() - path[0]) / length).sqrt() - 1;
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factor(Legendre(x, m));
  return Solved(factor, Eigen::MatrixXd::Identity(n, n));
}

}  // namespace

StageProjection ProjectStages(const std::vector<PathCurve>& curves) {
  std::vector<Eigen::MatrixXd> blocks;
  Index readings = 0, functions = 0;
  for (const PathCurve& curve : curves) {
    for (std::size_t first = 0, last = 0; first < curve.stage.size(); first = last) {
      while (last < curve.stage.size() && curve.stage[last] == curve.stage[first]) ++last;
      blocks.push_back(ProjectOne(
          curve.path.segment(static_cast<Index>(first), static_cast<Index>(last - first))));
      readings += blocks.back().cols();
      functions += blocks.back().rows();
    }
  }
  StageProjection result;
  result.matrix = Eigen::MatrixXd::Zero(functions, readings);
  Index row = 0, column = 0;
  for (const Eigen::MatrixXd& block : blocks) {
    result.matrix.block(row, column, block.rows(), block.cols()) = block;
    for (Index k = 0; k < block.rows(); ++k) result.degree.push_back(static_cast<int>(k));
    row += block.rows();
    column += block.cols();
  }
  return result;
}

}  // namespace calib::inference
