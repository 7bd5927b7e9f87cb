#include "inference/diagnosis/whitened.h"

#include <algorithm>
#include <utility>

#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kFewestDraws = 50;  // chosen: the variance of squares is then known to a fifth
constexpr Index kAtOnce = 32;       // offsets whose products stay in the cache

absl::StatusOr<Whitened> WhitenByCovariance(const Eigen::MatrixXd& covariance,
                                            const Histories& histories) {
  auto factor = std::make_shared<Eigen::LLT<Eigen::MatrixXd>>(covariance);
  if (factor->info() != Eigen::Success) {
    return absl::InvalidArgumentError("diagnosis: the covariance is not positive definite");
  }
  return WhitenBy(std::move(factor), histories);
}

bool GroupsFit(const FittedModel& model) {
  const auto groups = static_cast<int>(model.without.size());
  if (groups == 0) return true;
  const Index t = model.histories.readings();
  return static_cast<Index>(model.group.size()) == model.draws.rows() &&
         std::all_of(model.group.begin(), model.group.end(),
                     [groups](int g) { return g >= 0 && g < groups; }) &&
         std::all_of(model.without.begin(), model.without.end(),
                     [t](const Eigen::MatrixXd& c) { return c.rows() == t && c.cols() == t; });
}

}  // namespace

Whitened WhitenBy(CovarianceFactor factor, const Histories& histories) {
  Whitened whitened{.factor = std::move(factor), .axes = {}, .points = {}, .squares = {}};
  const Eigen::MatrixXd shapes = LowerSolved(*whitened.factor, histories.shapes());
  const Index t = shapes.rows();
  const Index q = shapes.cols();
  if (q < t) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(shapes);
    whitened.axes = OrthonormalColumns(qr);
    whitened.points =
        qr.matrixQR().topRows(q).triangularView<Eigen::Upper>() * histories.coefficients();
  } else {
    whitened.axes.setIdentity(t, t);
    whitened.points = shapes * histories.coefficients();
  }
  whitened.squares = whitened.points.colwise().squaredNorm();
  return whitened;
}

absl::StatusOr<Whitened> Whiten(const FittedModel& model) {
  const Index t = model.histories.readings();
  if (model.histories.points() < 1 || t < 1 || model.covariance.rows() != t ||
      model.covariance.cols() != t || !model.histories.AllFinite()) {
    return absl::InvalidArgumentError("diagnosis: histories and covariance do not fit together");
  }
  return WhitenByCovariance(model.covariance, model.histories);
}

absl::StatusOr<std::vector<DrawnGroup>> DrawsOf(const FittedModel& model) {
  std::vector<DrawnGroup> groups;
  const Index count = model.draws.rows();
  if (count == 0) return groups;
  if (count < kFewestDraws || model.draws.cols() != model.histories.readings() ||
      !model.draws.allFinite() || !GroupsFit(model)) {
    return absl::InvalidArgumentError(
        "diagnosis: draws of a measurement are too few or do not fit the histories");
  }
  std::vector<std::vector<Index>> numbers(std::max<std::size_t>(1, model.without.size()));
  for (Index i = 0; i < count; ++i) {
    const int group = model.without.empty() ? 0 : model.group[static_cast<std::size_t>(i)];
    numbers[static_cast<std::size_t>(group)].push_back(i);
  }
  for (std::size_t g = 0; g < numbers.size(); ++g) {
    if (numbers[g].empty()) continue;
    ASSIGN_OR_RETURN(auto whitened,
                     WhitenByCovariance(model.without.empty() ? model.covariance : model.without[g],
                                        model.histories));
    const Eigen::MatrixXd own = model.draws(numbers[g], Eigen::all).transpose();
    Eigen::MatrixXd draws = LowerSolved(*whitened.factor, own);
    groups.push_back(
        {.model = std::move(whitened), .number = std::move(numbers[g]), .draws = std::move(draws)});
  }
  return groups;
}

Eigen::MatrixXd Along(const Whitened& whitened, const Eigen::MatrixXd& directions) {
  return whitened.points.transpose() * (whitened.axes.transpose() * directions);
}

Eigen::VectorXd DistancesFrom(const Whitened& whitened, const Eigen::VectorXd& offset) {
  return (whitened.squares + 2 * Along(whitened, offset)).array() + offset.squaredNorm();
}

Nearest NearestTo(const Whitened& whitened, const Eigen::MatrixXd& offsets) {
  Nearest nearest{.squares = Eigen::VectorXd(offsets.cols()),
                  .points = std::vector<Index>(static_cast<std::size_t>(offsets.cols()))};
  for (Index s = 0; s < offsets.cols(); s += kAtOnce) {
    const auto some = offsets.middleCols(s, std::min(kAtOnce, offsets.cols() - s));
    const Eigen::MatrixXd along = Along(whitened, some);
    for (Index k = 0; k < some.cols(); ++k) {
      nearest.squares[s + k] = (whitened.squares + 2 * along.col(k))
                                   .minCoeff(&nearest.points[static_cast<std::size_t>(s + k)]) +
                               some.col(k).squaredNorm();
    }
  }
  return nearest;
}

}  // namespace calib::inference
