#include "inference/diagnosis/stage_coordinates.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/special_functions.h"
#include "inference/scatter/shrunk_covariance.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kSensitivityShare = 0.99;  // of squared sensitivities that is kept
constexpr int kSignaturePoints = 4;         // base runs at which signatures are taken
constexpr int kSensitivityPoints = 9;       // and sensitivities
// A signature at three units below this length, in sd of a measurement, has no direction.
constexpr double kShortestSignature = 0.3;

absl::Status CheckSetRuns(const SetRuns& runs, const CoordinateOptions& options) {
  const Index t = runs.histories.cols();
  std::size_t readings = 0;
  for (const PathCurve& curve : runs.curves) {
    readings += curve.stage.size();
    if (curve.stage.empty() || curve.path.size() != static_cast<Index>(curve.stage.size()) ||
        !curve.path.allFinite())
      return absl::InvalidArgumentError("a curve's stages and path do not fit");
  }
  if (static_cast<Index>(readings) != t || runs.histories.rows() != runs.points.rows() ||
      !runs.histories.allFinite())
    return absl::InvalidArgumentError("histories do not fit curves and runs, or are not finite");
  if (runs.noise.rows() != t || runs.noise.cols() != t || !runs.noise.allFinite() ||
      runs.noise.diagonal().minCoeff() < 0 ||
      (runs.staging.size() > 0 && (runs.staging.rows() != t || !runs.staging.allFinite())))
    return absl::InvalidArgumentError("noise or staging does not fit the histories");
  if (runs.differences.outputs.rows() > 0 && runs.differences.outputs.cols() != t)
    return absl::InvalidArgumentError("calculated differences do not fit the histories");
  if (runs.twins.rows() > 0 &&
      (runs.twins.rows() < 2 || runs.twins.cols() != t || !runs.twins.allFinite()))
    return absl::InvalidArgumentError("twins do not fit the histories, or there is one");
  if (!(runs.share > 0) || !(runs.share <= 1) || options.rest < 0 || options.count < 2 ||
      options.rest >= options.count)
    return absl::InvalidArgumentError("share, count or rest out of range");
  return absl::OkStatus();
}

// Rows evenly spread over these, at most n.
std::vector<Index> Spread(const std::vector<Index>& rows, int n) {
  const auto all = static_cast<Index>(rows.size());
  std::vector<Index> result;
  for (Index i = 0; i < std::min<Index>(n, all); ++i) {
    result.push_back(
        rows[static_cast<std::size_t>((2 * i + 1) * all / (2 * std::min<Index>(n, all)))]);
  }
  return result;
}

// Scatter of one specimen as runs without effects show it, about a mean that is fitted to them:
// departures (n x M) with `used` degrees of freedom gone.
Eigen::MatrixXd ScatterOf(const Eigen::MatrixXd& departures, double used, std::vector<int> packing,
                          const Eigen::MatrixXd& noise) {
  const auto n = static_cast<double>(departures.rows());
  const Eigen::MatrixXd scaled = departures * std::sqrt(n / std::max(n - used, 0.3 * n));
  const Eigen::MatrixXd target =
      (scaled.cwiseAbs2().colwise().mean().array() + 1e-300).matrix().asDiagonal();
  // On one packing each run is a witness of its own.
  if (std::adjacent_find(packing.begin(), packing.end(), std::not_equal_to<>()) == packing.end()) {
    for (std::size_t i = 0; i < packing.size(); ++i) packing[i] = static_cast<int>(i);
  }
  const Eigen::MatrixXd unit = target + noise;
  return ShrinkCovariance(scaled, packing, target, unit).covariance;
}

// Mean square of departures by the covariance of a measurement as runs on other packings give it,
// over that as all give it. On one packing each run stands for itself.
double OptimismOf(const Eigen::MatrixXd& departures, double used, const std::vector<int>& packing,
                  const Eigen::MatrixXd& noise, double share) {
  std::map<int, std::vector<Index>> on;
  for (std::size_t i = 0; i < packing.size(); ++i) on[packing[i]].push_back(static_cast<Index>(i));
  if (on.size() < 3) return 1;
  const auto square = [&](const Eigen::MatrixXd& scatter, const Eigen::MatrixXd& rows) {
    const Eigen::LLT<Eigen::MatrixXd> factor(share * scatter + noise);
    return LowerSolved(factor, rows.transpose()).squaredNorm();
  };
  const double all = square(ScatterOf(departures, used, packing, noise), departures);
  double others = 0;
  for (const auto& [number, rows] : on) {
    std::vector<Index> rest;
    std::vector<int> rest_packing;
    for (std::size_t i = 0; i < packing.size(); ++i) {
      if (packing[i] == number) continue;
      rest.push_back(static_cast<Index>(i));
      rest_packing.push_back(packing[i]);
    }
    const double part = static_cast<double>(rest.size()) / static_cast<double>(packing.size());
    others += square(ScatterOf(departures(rest, Eigen::all), part * used, rest_packing, noise),
                     departures(rows, Eigen::all));
  }
  return std::max(1.0, others / all);
}

Eigen::MatrixXd Orthogonal(const Eigen::MatrixXd& rows, const Eigen::MatrixXd& kept) {
  return rows - (rows * kept.transpose()) * kept;
}

// The leading right singular vectors of rows (n x M) as orthonormal rows: to `share` of their
// squares, at least `least` and at most `most`, none of a thousandth of the largest or less.
Eigen::MatrixXd LeadingDirections(const Eigen::MatrixXd& rows, double share, Index least,
                                  Index most) {
  const Index m = rows.cols();
  if (rows.rows() == 0 || most <= 0) return Eigen::MatrixXd(0, m);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(rows.transpose() * rows);
  const Eigen::VectorXd values = eigen.eigenvalues().cwiseMax(0);
  const double total = values.sum(), largest = values[m - 1];
  Index count = 0;
  for (double sum = 0; count < std::min(most, m); ++count) {
    const double value = values[m - 1 - count];
    if (value <= 1e-6 * largest || (count >= least && sum >= share * total)) break;
    sum += value;
  }
  return eigen.eigenvectors().rightCols(count).rowwise().reverse().transpose();
}

// Sensitivities of the emulator's base part at one point, d x M.
Eigen::MatrixXd SensitivitiesAt(const FeatureEmulator& emulator, const Eigen::MatrixXd& base) {
  const Index d = base.cols();
  Eigen::MatrixXd result(d, emulator.coordinates());
  for (Index j = 0; j < d; ++j) result.row(j) = emulator.BaseDerivative(base, j);
  return result;
}

// What each effect changes, freed of the sensitivities at its point, of length one; n x M.
Eigen::MatrixXd Signatures(const FeatureEmulator& emulator, const DesignPoints& at) {
  const EffectFeatures& features = emulator.features();
  std::vector<Eigen::RowVectorXd> found;
  for (Index i = 0; i < at.rows(); ++i) {
    const DesignPoints point = WithoutEffects(RowsOf(at, {i}));
    const Eigen::MatrixXd without = emulator.PredictMean(point);
    const Eigen::MatrixXd along =
        OrthonormalColumns(Eigen::HouseholderQR<Eigen::MatrixXd>(
                               SensitivitiesAt(emulator, point.base).transpose()))
            .transpose();
    for (int k = 0; k < static_cast<int>(features.effects().size()); ++k) {
      const DesignEffect& effect = features.effects()[static_cast<std::size_t>(k)];
      for (const double sign : effect.two_sided ? std::vector{1.0, -1.0} : std::vector{1.0}) {
        for (const double units : {1.0, 3.0}) {
          // At the middle of its shape, and at both sides of each shape parameter.
          for (int s = 0; s <= 2 * effect.shapes; ++s) {
            DesignPoints with = point;
            with.strength(0, k) = sign * units;
            with.shape.row(0).segment(features.first_shape(k), effect.shapes).setZero();
            if (s > 0)
              with.shape(0, features.first_shape(k) + (s - 1) / 2) = s % 2 == 0 ? 0.7 : -0.7;
            const Eigen::MatrixXd change = Orthogonal(emulator.PredictMean(with) - without, along);
            const double length = change.norm();
            if (length > kShortestSignature * units / 3) found.push_back(change.row(0) / length);
          }
        }
      }
    }
  }
  Eigen::MatrixXd result(static_cast<Index>(found.size()), emulator.coordinates());
  for (std::size_t i = 0; i < found.size(); ++i) result.row(static_cast<Index>(i)) = found[i];
  return result;
}

Eigen::MatrixXd Joined(const Eigen::MatrixXd& above, const Eigen::MatrixXd& below) {
  Eigen::MatrixXd result(above.rows() + below.rows(), above.cols());
  result.topRows(above.rows()) = above;
  result.bottomRows(below.rows()) = below;
  return result;
}

}  // namespace

absl::StatusOr<StageCoordinates> StageCoordinates::Fit(const SetRuns& runs,
                                                       const CoordinateOptions& options) {
  RETURN_IF_ERROR(CheckSetRuns(runs, options));
  const StageProjection projection = ProjectStages(runs.curves);
  const Eigen::MatrixXd& a = projection.matrix;
  const Index m = a.rows(), d = runs.points.base.cols();

  // Scatter about a polynomial of the runs without effects.
  std::vector<Index> without;
  std::vector<int> packing;
  for (Index i = 0; i < runs.points.rows(); ++i) {
    if ((runs.points.strength.row(i).array() != 0).any()) continue;
    without.push_back(i);
    packing.push_back(runs.packing[static_cast<std::size_t>(i)]);
  }
  const auto base_runs = static_cast<Index>(without.size());
  const EffectFeatures polynomial(d, {}, EffectFeatures::DegreeFor(d, base_runs));
  if (base_runs < polynomial.base_count() + 10) {
    return absl::FailedPreconditionError(absl::StrCat(
        base_runs, " runs without effects; ", polynomial.base_count() + 10, " are asked for"));
  }
  const Eigen::RowVectorXd mean = runs.histories(without, Eigen::all).colwise().mean();
  const Eigen::MatrixXd raw = (runs.histories.rowwise() - mean) * a.transpose();  // N x M
  const Eigen::MatrixXd raw_base = raw(without, Eigen::all);
  const Eigen::RowVectorXd sd = (raw_base.cwiseAbs2().colwise().mean().array() + 1e-300).sqrt();
  const DesignPoints at{.base = runs.points.base(without, Eigen::all),
                        .strength = Eigen::MatrixXd(base_runs, 0),
                        .shape = Eigen::MatrixXd(base_runs, 0)};
  const Eigen::MatrixXd scaled = raw_base.array().rowwise() / sd.array();
  ASSIGN_OR_RETURN(
      const FeatureEmulator trend,
      FeatureEmulator::Fit(
          polynomial, {.points = at, .packing = packing, .outputs = scaled, .differences = {}}));
  const Eigen::MatrixXd noise = a * runs.noise * a.transpose();
  const Eigen::MatrixXd scatter =
      ScatterOf(trend.residuals() * sd.asDiagonal(), trend.used(), packing, noise);
  const Eigen::LLT<Eigen::MatrixXd> factor(runs.share * scatter + noise);
  if (factor.info() != Eigen::Success)
    return absl::InvalidArgumentError("scatter and noise together are no covariance");
  const Eigen::MatrixXd lower = factor.matrixL();
  const Eigen::MatrixXd whitener = LowerSolved(factor, a);  // M x T

  // An emulator of all functions, from which directions are taken.
  const Index all_runs = runs.points.rows();
  const EffectFeatures features(d, runs.effects, EffectFeatures::DegreeFor(d, all_runs));
  EmulatorData data{.points = runs.points,
                    .packing = runs.packing,
                    .outputs = (runs.histories.rowwise() - mean) * whitener.transpose(),
                    .differences = runs.differences};
  if (data.differences.outputs.rows() > 0)
    data.differences.outputs = runs.differences.outputs * whitener.transpose();
  ASSIGN_OR_RETURN(FeatureEmulator all,
                   FeatureEmulator::Fit(features, data, {.max_iterations = 12}));
  StageCoordinates result(std::move(all));
  const Index q = std::min<Index>(options.count, m);
  const std::vector<Index> spread = Spread(without, kSensitivityPoints);
  Eigen::MatrixXd sensitivities(0, m);
  for (const Index i : spread)
    sensitivities = Joined(sensitivities, SensitivitiesAt(result.all_, runs.points.base.row(i)));
  Eigen::MatrixXd kept = LeadingDirections(sensitivities, kSensitivityShare, std::min(d, q - 1),
                                           std::min(2 * d, q - 1));
  const Eigen::MatrixXd signatures =
      Signatures(result.all_, RowsOf(runs.points, Spread(without, kSignaturePoints)));
  kept = Joined(kept, LeadingDirections(Orthogonal(signatures, kept), 1, 0,
                                        q - kept.rows() - std::min<Index>(options.rest, m - q)));
  // Constants and trends of stages as functionals of whitened functions, then whatever is left.
  Eigen::MatrixXd smooth(0, m);
  for (Index i = 0; i < m; ++i) {
    if (projection.degree[static_cast<std::size_t>(i)] < 2)
      smooth = Joined(smooth, lower.row(i) / lower.row(i).norm());
  }
  kept = Joined(kept, LeadingDirections(Orthogonal(smooth, kept), 1, 0, q - kept.rows()));
  kept = Joined(kept, LeadingDirections(Orthogonal(Eigen::MatrixXd::Identity(m, m), kept), 1, 0,
                                        q - kept.rows()));
  for (Index i = 0; i < signatures.rows(); ++i)
    result.captured_.push_back((signatures.row(i) * kept.transpose()).squaredNorm());
  result.rest_ = LeadingDirections(Orthogonal(Eigen::MatrixXd::Identity(m, m), kept), 1, 0, m - q);

  // Turned and scaled: scatter and noise diagonal, their sum one.
  const Eigen::MatrixXd outputs = data.outputs * kept.transpose();
  data.outputs = outputs;
  if (data.differences.outputs.rows() > 0)
    data.differences.outputs = Eigen::MatrixXd(data.differences.outputs * kept.transpose());
  ASSIGN_OR_RETURN(const FeatureEmulator few,
                   FeatureEmulator::Fit(features, data, {.max_iterations = 12}));
  const Eigen::MatrixXd kept_weights = kept * whitener;  // q x T
  const Eigen::MatrixXd kept_noise = kept_weights * runs.noise * kept_weights.transpose();
  const Eigen::MatrixXd departures = few.residuals()(without, Eigen::all);
  const double base_part = static_cast<double>(base_runs) / static_cast<double>(all_runs);
  const double used = few.used() * base_part;
  const Eigen::MatrixXd kept_scatter = ScatterOf(departures, used, packing, kept_noise);
  const Eigen::LLT<Eigen::MatrixXd> sum(runs.share * kept_scatter + kept_noise);
  const Eigen::MatrixXd half = LowerSolved(sum, kept_noise);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(LowerSolved(sum, half.transpose()));
  result.weights_ = eigen.eigenvectors().transpose() * LowerSolved(sum, kept_weights);
  result.noise_ = eigen.eigenvalues().cwiseMax(0);
  result.optimism_ = OptimismOf(departures, used, packing, kept_noise, runs.share);
  result.mean_ = mean;
  result.whitener_ = whitener;
  // What is left out: its scatter as seen, since it is not inverted, with noise and staging.
  const Eigen::MatrixXd left =
      result.all_.residuals()(without, Eigen::all) * result.rest_.transpose();
  const Eigen::MatrixXd rest_whitener = result.rest_ * whitener;
  result.rest_covariance_ = rest_whitener * runs.noise * rest_whitener.transpose() +
                            runs.share /
                                (static_cast<double>(base_runs) - result.all_.used() * base_part) *
                                left.transpose() * left;
  if (runs.staging.size() > 0) {
    const Eigen::MatrixXd staging = rest_whitener * runs.staging;
    result.rest_covariance_ += staging * staging.transpose();
  }
  if (!result.weights_.allFinite())
    return absl::InvalidArgumentError("scatter and noise of the coordinates are no covariance");
  return result;
}

Eigen::MatrixXd StageCoordinates::HistoriesAt(const DesignPoints& points) const {
  const Eigen::MatrixXd functions = all_.Predict(points).mean;  // n x M
  // The shortest change of a history that has these functions.
  const Eigen::LLT<Eigen::MatrixXd> gram(whitener_ * whitener_.transpose());
  const Eigen::MatrixXd change = whitener_.transpose() * gram.solve(functions.transpose());
  return change.transpose().rowwise() + mean_;
}

LeftOutMisfit StageCoordinates::LeftOut(const Eigen::VectorXd& history,
                                        const DesignPoints& point) const {
  if (rest_.rows() == 0) return {};
  const EmulatorPrediction prediction = all_.Predict(point);
  const Eigen::VectorXd residual =
      rest_ * (whitener_ * (history - mean_.transpose()) - prediction.mean.row(0).transpose());
  const Eigen::VectorXd not_known = prediction.variance.row(0).transpose() +
                                    prediction.added_run_variance[0] * all_.variances().run;
  const Eigen::MatrixXd v = rest_covariance_ + rest_ * not_known.asDiagonal() * rest_.transpose();
  const double square = residual.squaredNorm(), expected = v.trace();
  const FisherLaw law{.numerator = expected * expected / v.squaredNorm(),
                      .denominator = all_.freedom()};
  return {.square = square, .expected = expected, .chance = law.Tail(square / expected)};
}

}  // namespace calib::inference
