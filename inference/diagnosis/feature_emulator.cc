#include "inference/diagnosis/feature_emulator.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "inference/numerics/decompositions.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Weight of a calculated difference: runs of weight one scatter by one, and what the features miss
// of a smooth curve is taken for a seventh of that.
constexpr double kDifferenceWeight = 50;
// Weight of the start value of a prior variance, in coefficients: a group of one feature in twenty
// coordinates is known by its own numbers.
constexpr double kStartWeight = 4;
// The likelihood has outliers that no covariance knows of: more freedom is not granted.
constexpr double kMostFreedom = 20;

// Prior variances to start from, in units of scatter: lambda = 21 at unit strength is about one per
// coordinate of twenty; the rest is a fraction of that, the base campaign's range is wide.
double StartVariance(const FeatureGroup& group) {
  switch (group.kind) {
    case FeatureKind::kBase:
      return group.number < 2 ? 1e4 : group.number == 2 ? 25 : group.number == 3 ? 4 : 1;
    case FeatureKind::kMain:
      return 1;
    case FeatureKind::kInteraction:
    case FeatureKind::kCurvature:
    case FeatureKind::kShape:
      return 0.3;
    case FeatureKind::kCurvatureByBase:
      return 0.1;
  }
  return 1;
}

bool Shrunk(const FeatureGroup& group) {
  return group.kind != FeatureKind::kBase || group.number >= 2;
}

absl::Status CheckEmulatorData(const EffectFeatures& features, const EmulatorData& data) {
  const Index n = data.points.rows();
  const CalculatedDifferences& d = data.differences;
  if (!features.Fits(data.points) || static_cast<Index>(data.packing.size()) != n ||
      data.outputs.rows() != n || data.outputs.cols() == 0 || !data.outputs.allFinite())
    return absl::InvalidArgumentError("runs, packings and outputs do not fit or are not finite");
  if (d.outputs.rows() > 0 &&
      (!features.Fits(d.with) || !features.Fits(d.without) || d.with.rows() != d.outputs.rows() ||
       d.without.rows() != d.outputs.rows() || d.outputs.cols() != data.outputs.cols() ||
       !d.outputs.allFinite()))
    return absl::InvalidArgumentError("calculated differences do not fit or are not finite");
  for (int k = 0; k < static_cast<int>(features.effects().size()); ++k) {
    const Index runs = (data.points.strength.col(k).array() != 0).count();
    const Index calculated =
        d.outputs.rows() > 0
            ? (d.with.strength.col(k) - d.without.strength.col(k)).cwiseAbs().count()
            : 0;
    if (runs + calculated < 2) {
      return absl::FailedPreconditionError(
          absl::StrCat("effect ", k, " is on in ", runs, " runs and ", calculated,
                       " calculated differences; two are asked for"));
    }
    if (!features.effects()[static_cast<std::size_t>(k)].two_sided &&
        (data.points.strength.col(k).array() < 0).any()) {
      return absl::InvalidArgumentError(
          absl::StrCat("effect ", k, " has one sign, and a run has a negative strength of it"));
    }
  }
  if (n < features.base_count() + 10) {
    return absl::FailedPreconditionError(absl::StrCat(
        n, " runs are too few for an emulator; ", features.base_count() + 10, " are asked for"));
  }
  return absl::OkStatus();
}

// Rows of the fit: features and packings of runs, then differences; with their sums.
struct EmulatorRows {
  Eigen::MatrixXd x;         // N x (P + G)
  Eigen::VectorXd weight;    // N
  Eigen::MatrixXd squares;   // (P + G)^2: X^T W X over all rows
  Eigen::MatrixXd products;  // (P + G) x q: X^T W Y
  Index packings = 0;        // G, 0 where all runs are on one
};

EmulatorRows MakeRows(const EffectFeatures& features, const EmulatorData& data,
                      const RunVariance& kappa) {
  std::map<int, Index> place;
  for (const int p : data.packing) place.emplace(p, 0);
  Index next = 0;
  for (auto& [packing, index] : place) index = next++;
  EmulatorRows rows;
  rows.packings = place.size() < 2 ? 0 : static_cast<Index>(place.size());
  const Index n = data.points.rows(), p = features.count();
  rows.x = Eigen::MatrixXd::Zero(n, p + rows.packings);
  rows.x.leftCols(p) = features.All(data.points);
  for (Index i = 0; i < n && rows.packings > 0; ++i)
    rows.x(i, p + place[data.packing[static_cast<std::size_t>(i)]]) = 1;
  const Eigen::MatrixXd terms = features.VarianceTerms(data.points);
  rows.weight =
      (1 + kappa.single * terms.col(0).array() + kappa.pair * terms.col(1).array()).inverse();
  const Eigen::MatrixXd weighted = rows.weight.asDiagonal() * rows.x;
  rows.squares = rows.x.transpose() * weighted;
  rows.products = weighted.transpose() * data.outputs;
  if (data.differences.outputs.rows() > 0) {
    const Eigen::MatrixXd d =
        features.All(data.differences.with) - features.All(data.differences.without);
    rows.squares.topLeftCorner(p, p) += kDifferenceWeight * d.transpose() * d;
    rows.products.topRows(p) += kDifferenceWeight * d.transpose() * data.differences.outputs;
  }
  return rows;
}

// Posterior of all coefficients at given variances.
struct CoefficientPosterior {
  Eigen::MatrixXd directions;  // sqrt(tau) U
  Eigen::MatrixXd shrink;      // 1 / (D / sigma^2 + 1) for each coordinate
  Eigen::MatrixXd mean;        // (P + G) x q
  Eigen::VectorXd used;        // q: degrees of freedom used
};

CoefficientPosterior PosteriorAt(const EmulatorRows& rows, const Eigen::VectorXd& tau,
                                 const Eigen::VectorXd& run) {
  const Eigen::VectorXd root = tau.cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(root.asDiagonal() * rows.squares *
                                                             root.asDiagonal());
  const Eigen::VectorXd d = eigen.eigenvalues().cwiseMax(0);
  CoefficientPosterior result;
  result.directions = root.asDiagonal() * eigen.eigenvectors();
  const Eigen::ArrayXXd ratio = d.array().matrix() * run.cwiseInverse().transpose();
  result.shrink = (1 + ratio).inverse();
  result.used = (ratio * result.shrink.array()).colwise().sum();
  const Eigen::MatrixXd along = result.directions.transpose() * rows.products;
  result.mean =
      result.directions * along.cwiseProduct(result.shrink) * run.cwiseInverse().asDiagonal();
  return result;
}

Eigen::VectorXd VarianceOfEach(const EffectFeatures& features, const EmulatorVariances& variances,
                               Index packings) {
  Eigen::VectorXd tau(features.count() + packings);
  for (Index i = 0; i < features.count(); ++i)
    tau[i] = variances.group[features.group_of()[static_cast<std::size_t>(i)]];
  tau.tail(packings).setConstant(variances.packing);
  return tau;
}

EmulatorVariances StartVariances(const EffectFeatures& features, Index coordinates) {
  EmulatorVariances result;
  const auto groups = static_cast<Index>(features.groups().size());
  result.group.resize(groups);
  for (Index g = 0; g < groups; ++g)
    result.group[g] = StartVariance(features.groups()[static_cast<std::size_t>(g)]);
  result.run = Eigen::VectorXd::Constant(coordinates, 0.8);
  return result;
}

// One step of the fixed point; the largest change of the logarithm of a run variance.
double ImproveVariances(const EffectFeatures& features, const EmulatorData& data,
                        const EmulatorRows& rows, const EmulatorVariances& start,
                        EmulatorVariances& variances) {
  const CoefficientPosterior posterior =
      PosteriorAt(rows, VarianceOfEach(features, variances, rows.packings), variances.run);
  const Index q = data.outputs.cols(), n = rows.x.rows();
  // Sum over coordinates of mean^2 + variance of each coefficient.
  const Eigen::VectorXd squares =
      posterior.mean.rowwise().squaredNorm() +
      posterior.directions.cwiseAbs2() * posterior.shrink.rowwise().sum();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(variances.group.size());
  Eigen::VectorXd number = sum;
  for (Index i = 0; i < features.count(); ++i) {
    const int g = features.group_of()[static_cast<std::size_t>(i)];
    sum[g] += squares[i];
    number[g] += static_cast<double>(q);
  }
  for (Index g = 0; g < sum.size(); ++g) {
    if (Shrunk(features.groups()[static_cast<std::size_t>(g)]))
      variances.group[g] = (sum[g] + kStartWeight * start.group[g]) / (number[g] + kStartWeight);
  }
  if (rows.packings > 0) {
    variances.packing = (squares.tail(rows.packings).sum() + kStartWeight * start.packing) /
                        (static_cast<double>(q * rows.packings) + kStartWeight);
  }
  const Eigen::MatrixXd residual = data.outputs - rows.x * posterior.mean;
  double change = 0;
  for (Index c = 0; c < q; ++c) {
    // At least three tenths of the runs are left to judge by, however flexible the features.
    const double freedom = std::max(static_cast<double>(n) - posterior.used[c], 0.3 * n);
    const double run = std::max(residual.col(c).cwiseAbs2().dot(rows.weight) / freedom, 1e-12);
    change = std::max(change, std::abs(std::log(run / variances.run[c])));
    variances.run[c] = run;
  }
  return change;
}

LeftOutRuns LeaveOut(const EmulatorRows& rows, const CoefficientPosterior& posterior,
                     const Eigen::MatrixXd& outputs, const Eigen::VectorXd& run) {
  const Eigen::MatrixXd lever =
      (rows.x * posterior.directions).cwiseAbs2() * posterior.shrink;  // N x q
  LeftOutRuns result;
  result.error = outputs - rows.x * posterior.mean;
  result.variance.resize(outputs.rows(), outputs.cols());
  for (Index c = 0; c < outputs.cols(); ++c) {
    for (Index i = 0; i < outputs.rows(); ++i) {
      const double left = std::max(1 - lever(i, c) * rows.weight[i] / run[c], 1e-9);  // 1 - h
      result.error(i, c) /= left;
      result.variance(i, c) = run[c] / (rows.weight[i] * left);
    }
  }
  result.log_density = -0.5 * (result.error.array().square() / result.variance.array() +
                               (2 * M_PI * result.variance.array()).log())
                                  .sum();
  return result;
}

}  // namespace

absl::StatusOr<FeatureEmulator> FeatureEmulator::Fit(const EffectFeatures& features,
                                                     const EmulatorData& data,
                                                     const FeatureEmulatorOptions& options) {
  if (absl::Status status = CheckEmulatorData(features, data); !status.ok()) return status;
  const Index q = data.outputs.cols(), p = features.count(), n = data.points.rows();
  const EmulatorRows rows = MakeRows(features, data, options.run_variance);
  const EmulatorVariances start = StartVariances(features, q);
  FeatureEmulator result(features);
  result.run_variance_ = options.run_variance;
  EmulatorVariances& variances = result.variances_;
  variances = options.start.value_or(start);
  if (variances.group.size() != start.group.size() || variances.run.size() != q ||
      !(variances.group.minCoeff() > 0) || !(variances.run.minCoeff() > 0) ||
      !(variances.packing > 0))
    return absl::InvalidArgumentError("variances to start from do not fit or are not positive");
  for (bool moved = !options.hold; moved && result.iterations_ < options.max_iterations;) {
    moved = ImproveVariances(features, data, rows, start, variances) > options.tolerance;
    ++result.iterations_;
  }

  const CoefficientPosterior posterior =
      PosteriorAt(rows, VarianceOfEach(features, variances, rows.packings), variances.run);
  result.coefficients_ = posterior.mean.topRows(p);
  result.directions_ = posterior.directions.topRows(p);
  result.shrink_ = posterior.shrink;
  result.left_out_ = LeaveOut(rows, posterior, data.outputs, variances.run);
  result.residuals_ = rows.weight.cwiseSqrt().asDiagonal() *
                      (data.outputs - rows.x.leftCols(p) * result.coefficients_);

  const Eigen::VectorXd tau = VarianceOfEach(features, variances, 0);
  result.used_ = static_cast<double>(p) - tau.cwiseInverse().dot(result.directions_.cwiseAbs2() *
                                                                 result.shrink_.rowwise().sum()) /
                                              static_cast<double>(q);

  // Variance between packings in each coordinate, as far as they say, about that of all.
  const Index g = rows.packings;
  Eigen::VectorXd between = Eigen::VectorXd::Zero(q);
  if (g > 0 && options.hold) between.setConstant(variances.packing);
  if (g > 0 && !options.hold) {
    const Eigen::VectorXd sum =
        posterior.mean.bottomRows(g).colwise().squaredNorm() +
        posterior.directions.bottomRows(g).cwiseAbs2().colwise().sum() * posterior.shrink;
    between =
        (sum.array() + kStartWeight * variances.packing) / (static_cast<double>(g) + kStartWeight);
  }
  result.specimen_ = variances.run + between;
  for (Index c = 0; c < q; ++c) {
    const double run = variances.run[c];
    const double left = std::max(static_cast<double>(n) - posterior.used[c], 0.3 * n);
    const double inverse =
        run * run / left + (g > 1 ? between[c] * between[c] / static_cast<double>(g - 1) : 0.0);
    result.freedom_ += result.specimen_[c] * result.specimen_[c] / inverse / static_cast<double>(q);
  }
  result.freedom_ = std::min(result.freedom_, kMostFreedom);
  if (!result.coefficients_.allFinite() || !result.shrink_.allFinite())
    return absl::FailedPreconditionError("the emulator's coefficients are not finite");
  return result;
}

Eigen::MatrixXd FeatureEmulator::MeanOf(const Eigen::MatrixXd& coefficients,
                                        const DesignPoints& points) const {
  Eigen::MatrixXd mean = features_.Base(points.base) * coefficients.topRows(features_.base_count());
  for (int k = 0; k < static_cast<int>(features_.effects().size()); ++k) {
    if ((points.strength.col(k).array() == 0).all()) continue;
    const FeatureBlock& block = features_.block(k);
    mean += features_.Effect(k, points) * coefficients.middleRows(block.first, block.count);
  }
  return mean;
}

Eigen::MatrixXd FeatureEmulator::PredictMean(const DesignPoints& points) const {
  return MeanOf(coefficients_, points);
}

Eigen::MatrixXd FeatureEmulator::Factor(const DesignPoints& points) const {
  return MeanOf(directions_, points);
}

EmulatorPrediction FeatureEmulator::Predict(const DesignPoints& points) const {
  EmulatorPrediction result;
  result.mean = PredictMean(points);
  result.variance = Factor(points).cwiseAbs2() * shrink_;
  const Eigen::MatrixXd terms = features_.VarianceTerms(points);
  result.added_run_variance =
      run_variance_.single * terms.col(0) + run_variance_.pair * terms.col(1);
  return result;
}

Eigen::MatrixXd FeatureEmulator::BaseDerivative(const Eigen::MatrixXd& base, Index j) const {
  return features_.BaseDerivative(base, j) * coefficients_.topRows(features_.base_count());
}

Eigen::MatrixXd FeatureEmulator::Realisation(std::uint64_t seed, std::uint64_t number) const {
  PhiloxStream stream({.seed = seed,
                       .purpose = StreamPurpose::kDiagnosisEmulator,
                       .iteration = 0,
                       .sample = number});
  Eigen::MatrixXd normal(shrink_.rows(), shrink_.cols());
  for (double& z : normal.reshaped()) z = stream.Normal();
  return coefficients_ + directions_ * normal.cwiseProduct(shrink_.cwiseSqrt());
}

}  // namespace calib::inference
