#include "inference/sensitivity/sobol_indices.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "inference/emulator/gaussian_process.h"
#include "inference/sampling/shuffle.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Standard error of the mean of the columns' entries, over rows.
Eigen::RowVectorXd ErrorOfMean(const Eigen::MatrixXd& rows) {
  const auto n = static_cast<double>(rows.rows());
  const Eigen::RowVectorXd mean = rows.colwise().mean();
  return ((rows.rowwise() - mean).colwise().squaredNorm() / (n * (n - 1))).cwiseSqrt();
}

Eigen::VectorXd Ranks(const Eigen::VectorXd& values) {
  std::vector<Index> order(static_cast<std::size_t>(values.size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return values[a] < values[b]; });
  Eigen::VectorXd ranks(values.size());
  for (std::size_t first = 0; first < order.size();) {  // ties share their mean rank
    std::size_t last = first;
    while (last + 1 < order.size() && values[order[last + 1]] == values[order[first]]) ++last;
    for (std::size_t k = first; k <= last; ++k)
      ranks[order[k]] = 0.5 * static_cast<double>(first + last);
    first = last + 1;
  }
  return ranks;
}

double Correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  const Eigen::ArrayXd x = a.array() - a.mean();
  const Eigen::ArrayXd y = b.array() - b.mean();
  const double scale = std::sqrt(x.square().sum() * y.square().sum());
  return scale > 0 ? (x * y).sum() / scale : kNone;
}

// Of rows that were drawn with replacement from weighted ones: m^2 over the sum of squares of how
// often each stands there.
double EffectiveNumber(const Eigen::MatrixXd& points) {
  std::map<std::vector<double>, double> times;
  for (Index i = 0; i < points.rows(); ++i) {
    const Eigen::VectorXd row = points.row(i);
    times[{row.begin(), row.end()}] += 1;
  }
  double squares = 0;
  for (const auto& [row, count] : times) squares += count * count;
  const auto m = static_cast<double>(points.rows());
  return m * m / squares;
}

Eigen::MatrixXd ToStandard(const JointPrior& priors, const Eigen::MatrixXd& parameters) {
  Eigen::MatrixXd standard(parameters.rows(), parameters.cols());
  for (Index i = 0; i < parameters.rows(); ++i)
    standard.row(i) = priors.ToStandard(parameters.row(i));
  return standard;
}

// Whether a variance is no more than what rounding leaves of numbers of this size.
bool IsRounding(double variance, double size) {
  constexpr double kRelative = 1e-13;
  return !(variance > kRelative * kRelative * size * size);
}

// What one emulator says of one output; indices and correlation zero where it is constant.
struct Analysed {
  SobolIndices indices;
  double mean = 0, sd = 0;
  Eigen::VectorXd correlation;
};

Analysed Analyse(const GaussianProcess& process, const JointPrior& priors,
                 const Eigen::MatrixXd& standard_points, const std::vector<Eigen::VectorXd>& ranks,
                 bool indices, const SobolOptions& options) {
  const auto d = static_cast<int>(priors.size());
  Analysed result;
  const bool indexed = indices && priors.is_independent() && !priors.is_constrained();
  if (process.constant()) {
    result.mean = process.Predict(standard_points.topRows(1)).mean[0];
    result.correlation = Eigen::VectorXd::Zero(d);
    if (indexed) result.indices.first = result.indices.total = Eigen::VectorXd::Zero(d);
    return result;
  }
  if (indexed) {
    const auto f = [&](const Eigen::MatrixXd& unit) -> Eigen::MatrixXd {
      Eigen::MatrixXd standard(unit.rows(), unit.cols());
      for (Index i = 0; i < unit.rows(); ++i)
        standard.row(i) = priors.ToStandard(priors.FromUnit(unit.row(i)));
      return process.Predict(standard).mean;
    };
    result.indices = EstimateSobolIndices(d, options, f).front();
  }
  const Eigen::VectorXd at_points = process.Predict(standard_points).mean;
  result.mean = at_points.mean();
  result.sd = std::sqrt((at_points.array() - result.mean).square().mean());
  const Eigen::VectorXd own = Ranks(at_points);
  result.correlation.resize(d);
  for (int j = 0; j < d; ++j)
    result.correlation[j] = Correlation(own, ranks[static_cast<std::size_t>(j)]);
  return result;
}

}  // namespace

bool OutputSensitivity::Explains() const { return explained >= kLeastExplained; }

std::vector<SobolIndices> EstimateSobolIndices(int dimensions, const SobolOptions& options,
                                               const UnitFunction& f) {
  const Index d = dimensions;
  const Index n = options.points;
  std::vector<Eigen::MatrixXd> first;  // [output]: replicates x d
  std::vector<Eigen::MatrixXd> total;
  Eigen::MatrixXd means;      // replicates x outputs
  Eigen::MatrixXd variances;  // likewise
  for (int r = 0; r < options.replicates; ++r) {
    const Eigen::MatrixXd both = ScrambledSobol(
        options.points, 2 * dimensions, options.seed * 1000 + static_cast<std::uint64_t>(r));
    const Eigen::MatrixXd a = both.leftCols(d);
    const Eigen::MatrixXd b = both.rightCols(d);
    const Eigen::MatrixXd at_a = f(a);
    const Eigen::MatrixXd at_b = f(b);
    const Index k = at_a.cols();
    if (r == 0) {
      first.assign(static_cast<std::size_t>(k), Eigen::MatrixXd(options.replicates, d));
      total = first;
      means.resize(options.replicates, k);
      variances.resize(options.replicates, k);
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
    const double scale =
        IsRounding(indices.variance, std::abs(indices.mean)) ? kNone : indices.variance;
    indices.first = first[o].colwise().mean() / scale;
    indices.total = total[o].colwise().mean() / scale;
    indices.first_error = ErrorOfMean(first[o]) / scale;
    indices.total_error = ErrorOfMean(total[o]) / scale;
  }
  return all;
}

absl::StatusOr<std::vector<OutputSensitivity>> AnalyseSensitivity(
    const JointPrior& priors, const Eigen::MatrixXd& parameters, const Eigen::MatrixXd& outputs,
    const Eigen::MatrixXd& points, const SensitivityOptions& options) {
  const auto d = static_cast<Index>(priors.size());
  if (parameters.cols() != d || points.cols() != d || outputs.rows() != parameters.rows() ||
      points.rows() < 3 || options.folds < 2) {
    return absl::InvalidArgumentError("sensitivity: parameters, outputs and points do not fit.");
  }
  const Index least = std::max<Index>(20, 3 * d);
  if (parameters.rows() < least) {
    return absl::FailedPreconditionError(absl::StrCat("sensitivity: an emulator needs at least ",
                                                      least, " finished runs; there are ",
                                                      parameters.rows(), "."));
  }
  const Index used = std::min<Index>(parameters.rows(), options.max_runs);
  // By chance: the order of the runs may be that of a grid or a sequence.
  std::vector<Index> rows =
      Shuffled(parameters.rows(), PhiloxStream({.seed = options.sobol.seed,
                                                .purpose = StreamPurpose::kSensitivity,
                                                .iteration = 0,
                                                .sample = 0}));
  rows.resize(static_cast<std::size_t>(used));
  const Eigen::MatrixXd inputs = ToStandard(priors, parameters(rows, Eigen::all));
  const Eigen::MatrixXd values = outputs(rows, Eigen::all);
  const Eigen::MatrixXd standard_points = ToStandard(priors, points);
  std::vector<Eigen::VectorXd> ranks;
  for (Index j = 0; j < d; ++j) ranks.push_back(Ranks(points.col(j)));
  const double effective = EffectiveNumber(points);
  // The jackknife needs differences between emulators alone, at the same points.
  SobolOptions coarse = options.sobol;
  coarse.replicates = 2;

  std::vector<OutputSensitivity> all;
  for (Index o = 0; o < values.cols(); ++o) {
    const auto process = GaussianProcess::Fit(inputs, values.col(o));
    if (!process.ok()) return process.status();
    Analysed whole =
        Analyse(*process, priors, standard_points, ranks, options.indices, options.sobol);
    OutputSensitivity& out = all.emplace_back();
    const double average = values.col(o).mean();
    const double variance = (values.col(o).array() - average).square().mean();
    const double missed = process->leave_one_out().error.squaredNorm() / static_cast<double>(used);
    out.mean = whole.mean;
    out.sd = std::hypot(whole.sd, std::sqrt(missed));
    out.explained = IsRounding(variance, std::abs(average)) ? kNone : 1 - missed / variance;
    if (process->constant() || !out.Explains()) continue;
    out.correlation = std::move(whole.correlation);
    const bool indexed = whole.indices.first.size() > 0;
    out.indices = std::move(whole.indices);

    const auto none_is_zero = [](double v) { return std::isfinite(v) ? v : 0.0; };
    Eigen::MatrixXd first(options.folds, d);
    Eigen::MatrixXd total(options.folds, d);
    Eigen::MatrixXd correlation(options.folds, d);
    for (int fold = 0; fold < options.folds; ++fold) {
      std::vector<Index> kept;
      for (Index i = 0; i < used; ++i) {
        if (i % options.folds != fold) kept.push_back(i);
      }
      const auto part = GaussianProcess::Fit(inputs(kept, Eigen::all), values.col(o)(kept));
      if (!part.ok()) return part.status();
      const Analysed left_out =
          Analyse(*part, priors, standard_points, ranks, options.indices, coarse);
      if (indexed) {
        first.row(fold) = left_out.indices.first.unaryExpr(none_is_zero);
        total.row(fold) = left_out.indices.total.unaryExpr(none_is_zero);
      }
      correlation.row(fold) = left_out.correlation.unaryExpr(none_is_zero);
    }
    const double inflation = options.folds - 1;  // of ErrorOfMean to the delete-a-group jackknife
    const auto join = [&](const Eigen::MatrixXd& parts, const Eigen::VectorXd& sampling) {
      const Eigen::VectorXd jackknife = inflation * ErrorOfMean(parts).transpose();
      return Eigen::VectorXd((jackknife.cwiseAbs2() + sampling.cwiseAbs2()).cwiseSqrt());
    };
    if (indexed) {
      out.indices.first_error = join(first, out.indices.first_error);
      out.indices.total_error = join(total, out.indices.total_error);
    }
    const Eigen::VectorXd sampling =
        (1 - out.correlation.array().square()) / std::sqrt(std::max(1.0, effective - 1));
    out.correlation_error = join(correlation, sampling);
  }
  return all;
}

}  // namespace calib::inference
