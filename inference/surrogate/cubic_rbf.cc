#include "inference/surrogate/cubic_rbf.h"

#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Points that cannot be told apart, relative; chosen: the interpolant of what is closer would be
// rounding.
constexpr double kCoincides = 1e-9;   // distance, over 1 + the point's size
constexpr double kFlatSpan = 1e-8;    // pivot of a hyperplane's points, over the largest
constexpr double kVanishing = 1e-15;  // pivot of the Cholesky factor's row, over its diagonal

double Cubic(double r) { return r * r * r; }

}  // namespace

absl::Status CubicRbf::Add(const Eigen::VectorXd& point, double value) {
  assert(point.size() == dimensions_);
  if (!point.allFinite() || !std::isfinite(value)) {
    return absl::InvalidArgumentError("a point of the surrogate or its value is not finite.");
  }
  for (int i = 0; i < size(); ++i) {
    if ((point - points_[static_cast<std::size_t>(i)]).norm() <= kCoincides * (1 + point.norm())) {
      return absl::InvalidArgumentError(
          absl::StrCat("a point of the surrogate coincides with its point ", i, "."));
    }
  }
  points_.push_back(point);
  values_.push_back(value);
  const auto withdraw = [this] {
    points_.pop_back();
    values_.pop_back();
    return absl::InvalidArgumentError(
        "a point of the surrogate lies too close to the others to tell them apart.");
  };
  if (ready()) {
    if (!AppendRow(size() - 1)) return withdraw();
    Solve();
  } else if (ChooseTailPoints()) {
    for (int i = 0; i < size(); ++i) {
      if (std::binary_search(tail_points_.begin(), tail_points_.end(), i)) continue;
      if (AppendRow(i)) continue;
      tail_points_.clear();
      others_.clear();
      borders_.clear();
      solved_.clear();
      factor_.clear();
      return withdraw();
    }
    Solve();
  }
  return absl::OkStatus();
}

// The d + 1 points that pivoting finds farthest from a common hyperplane.
bool CubicRbf::ChooseTailPoints() {
  const Index m = dimensions_ + 1;
  if (size() < m) return false;
  Eigen::MatrixXd tail(m, size());
  for (int i = 0; i < size(); ++i) tail.col(i) << 1, points_[static_cast<std::size_t>(i)];
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> pivoted(tail);
  pivoted.setThreshold(kFlatSpan);
  if (pivoted.rank() < m) return false;
  for (Index k = 0; k < m; ++k) tail_points_.push_back(pivoted.colsPermutation().indices()[k]);
  std::sort(tail_points_.begin(), tail_points_.end());

  Eigen::MatrixXd block = Eigen::MatrixXd::Zero(2 * m, 2 * m);
  for (Index k = 0; k < m; ++k) {
    const Eigen::VectorXd border = Border(tail_points_[static_cast<std::size_t>(k)]);
    block.col(m + k) = border;
    block.row(m + k).head(m) = border.head(m).transpose();
  }
  block_ = std::make_shared<Eigen::PartialPivLU<Eigen::MatrixXd>>(block);
  return true;
}

Eigen::VectorXd CubicRbf::Border(int i) const {
  const Eigen::VectorXd& point = points_[static_cast<std::size_t>(i)];
  Eigen::VectorXd border(2 * dimensions_ + 2);
  border.head(dimensions_ + 1) << 1, point;
  for (int k = 0; k <= dimensions_; ++k) {
    const int tail_point = tail_points_[static_cast<std::size_t>(k)];
    border[dimensions_ + 1 + k] =
        Cubic((point - points_[static_cast<std::size_t>(tail_point)]).norm());
  }
  return border;
}

// One more row of the Cholesky factor of S; false when its pivot vanishes.
bool CubicRbf::AppendRow(int i) {
  const Eigen::VectorXd border = Border(i);
  const Eigen::VectorXd solved = block_->solve(border);
  const std::size_t n = others_.size();
  Eigen::VectorXd row(static_cast<Index>(n) + 1);
  for (std::size_t k = 0; k < n; ++k) {
    const double kernel =
        Cubic((points_[static_cast<std::size_t>(i)] - points_[static_cast<std::size_t>(others_[k])])
                  .norm());
    const auto j = static_cast<Index>(k);
    const double schur = kernel - borders_[k].dot(solved);
    row[j] = (schur - factor_[k].head(j).dot(row.head(j))) / factor_[k][j];
  }
  const auto last = static_cast<Index>(n);
  const double diagonal = -border.dot(solved);
  const double pivot = diagonal - row.head(last).squaredNorm();
  if (!(pivot > kVanishing * std::abs(diagonal))) return false;
  row[last] = std::sqrt(pivot);
  others_.push_back(i);
  borders_.push_back(border);
  solved_.push_back(solved);
  factor_.push_back(std::move(row));
  return true;
}

// [A B; B^T Phi_22] (c, lambda_1; lambda_2) = (0, f_1; f_2) by elimination of the first block.
void CubicRbf::Solve() {
  const Index m = dimensions_ + 1;
  Eigen::VectorXd first = Eigen::VectorXd::Zero(2 * m);
  for (Index k = 0; k < m; ++k)
    first[m + k] = values_[static_cast<std::size_t>(tail_points_[static_cast<std::size_t>(k)])];
  const Eigen::VectorXd particular = block_->solve(first);

  const std::size_t n = others_.size();
  Eigen::VectorXd second(static_cast<Index>(n));
  for (std::size_t k = 0; k < n; ++k) {  // forward
    const auto j = static_cast<Index>(k);
    const double right =
        values_[static_cast<std::size_t>(others_[k])] - borders_[k].dot(particular);
    second[j] = (right - factor_[k].head(j).dot(second.head(j))) / factor_[k][j];
  }
  for (std::size_t k = n; k-- > 0;) {  // backward
    const auto j = static_cast<Index>(k);
    second[j] /= factor_[k][j];
    second.head(j) -= second[j] * factor_[k].head(j);
  }
  Eigen::VectorXd block = particular;
  for (std::size_t k = 0; k < n; ++k) block -= second[static_cast<Index>(k)] * solved_[k];

  tail_ = block.head(m);
  coefficients_.resize(size());
  for (Index k = 0; k < m; ++k)
    coefficients_[tail_points_[static_cast<std::size_t>(k)]] = block[m + k];
  for (std::size_t k = 0; k < n; ++k) coefficients_[others_[k]] = second[static_cast<Index>(k)];
}

double CubicRbf::Value(const Eigen::VectorXd& x, const Eigen::VectorXd& distances) const {
  assert(ready());
  return tail_[0] + tail_.tail(dimensions_).dot(x) +
         coefficients_.dot(distances.array().cube().matrix());
}

double CubicRbf::Value(const Eigen::VectorXd& x) const {
  Eigen::VectorXd distances(size());
  for (int i = 0; i < size(); ++i) distances[i] = (x - point(i)).norm();
  return Value(x, distances);
}

Eigen::VectorXd CubicRbf::Gradient(const Eigen::VectorXd& x) const {
  assert(ready());
  Eigen::VectorXd gradient = tail_.tail(dimensions_);
  for (int i = 0; i < size(); ++i) {
    const Eigen::VectorXd difference = x - point(i);
    gradient += 3 * coefficients_[i] * difference.norm() * difference;
  }
  return gradient;
}

}  // namespace calib::inference
