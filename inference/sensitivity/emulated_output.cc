#include "inference/sensitivity/emulated_output.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/sampling/shuffle.h"
#include "inference/sensitivity/spread.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kNoIndex = std::numeric_limits<double>::quiet_NaN();
constexpr Index kFewestRunsForIndices =
    20;  // and three per parameter, for a process worth asking; chosen
constexpr Index kRunsPerParameter = 3;
constexpr int kTail = 20;  // one point in so many is left out at each end of the middle range
constexpr double kReachOfRuns = 2;  // ranges of the runs that the points may spread over; chosen
constexpr std::size_t kCoarseSets = 2;  // of the jackknife: differences need fewer; chosen

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
  return scale > 0 ? (x * y).sum() / scale : kNoIndex;
}

// Effective number of rows that were drawn with replacement from weighted ones: m^2 over the sum of
// squares of how often each stands there.
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

Eigen::MatrixXd RowsToStandard(const JointPrior& priors, const Eigen::MatrixXd& parameters) {
  Eigen::MatrixXd standard(parameters.rows(), parameters.cols());
  for (Index i = 0; i < parameters.rows(); ++i)
    standard.row(i) = priors.ToStandard(parameters.row(i));
  return standard;
}

// What one emulator says of one output; indices and correlation zero where it is constant.
struct Said {
  SobolIndices indices;
  double mean = 0, sd = 0;
  Eigen::VectorXd correlation;
};

Said Ask(const GaussianProcess& process, const JointPrior& priors, const RankedPoints& points,
         std::span<const Eigen::MatrixXd> sets) {
  const auto d = static_cast<Index>(priors.size());
  Said result;
  if (process.constant()) {
    result.mean = process.PredictMean(points.standard.topRows(1))[0];
    result.correlation = Eigen::VectorXd::Zero(d);
    if (!sets.empty()) result.indices.first = result.indices.total = Eigen::VectorXd::Zero(d);
    return result;
  }
  if (!sets.empty()) {
    const auto f = [&](const Eigen::MatrixXd& unit) -> Eigen::MatrixXd {
      Eigen::MatrixXd standard(unit.rows(), unit.cols());
      for (Index i = 0; i < unit.rows(); ++i)
        standard.row(i) = priors.ToStandard(priors.FromUnit(unit.row(i)));
      return process.PredictMean(standard);
    };
    result.indices = EstimateSobolIndices(sets, f).front();
  }
  const Eigen::VectorXd at_points = process.PredictMean(points.standard);
  result.mean = at_points.mean();
  result.sd = std::sqrt((at_points.array() - result.mean).square().mean());
  const Eigen::VectorXd own = Ranks(at_points);
  result.correlation.resize(d);
  for (Index j = 0; j < d; ++j)
    result.correlation[j] = Correlation(own, points.ranks[static_cast<std::size_t>(j)]);
  return result;
}

// Range of nine tenths of each column's entries.
Eigen::RowVectorXd MiddleRange(const Eigen::MatrixXd& points) {
  Eigen::RowVectorXd range(points.cols());
  const auto tail = static_cast<std::ptrdiff_t>(points.rows() / kTail);
  for (Index j = 0; j < points.cols(); ++j) {
    Eigen::VectorXd column = points.col(j);
    std::sort(column.begin(), column.end());
    range[j] = *(column.end() - 1 - tail) - *(column.begin() + tail);
  }
  return range;
}

bool MayHaveIndices(const JointPrior& priors) {
  return priors.is_independent() && !priors.is_constrained();
}

}  // namespace

bool OutputSensitivity::Explains() const { return explained >= kLeastExplained; }

RankedPoints Ranked(const JointPrior& priors, const Eigen::MatrixXd& points) {
  RankedPoints ranked{.standard = RowsToStandard(priors, points),
                      .ranks = {},
                      .effective = EffectiveNumber(points)};
  for (Index j = 0; j < points.cols(); ++j) ranked.ranks.push_back(Ranks(points.col(j)));
  return ranked;
}

absl::StatusOr<EmulatedOutput> EmulatedOutput::Fit(const JointPrior& priors,
                                                   const Eigen::MatrixXd& parameters,
                                                   const Eigen::VectorXd& outputs,
                                                   const SensitivityOptions& options) {
  const auto d = static_cast<Index>(priors.size());
  if (parameters.cols() != d || outputs.size() != parameters.rows() || options.folds < 2) {
    return absl::InvalidArgumentError("sensitivity: parameters and outputs do not fit.");
  }
  const Index least = std::max<Index>(kFewestRunsForIndices, kRunsPerParameter * d);
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
  const Eigen::MatrixXd inputs = RowsToStandard(priors, parameters(rows, Eigen::all));
  const Eigen::VectorXd values = outputs(rows);
  ASSIGN_OR_RETURN(auto whole, GaussianProcess::Fit(inputs, values));
  EmulatedOutput emulated(std::move(whole));
  const double average = values.mean();
  const double variance = (values.array() - average).square().mean();
  emulated.range_ = inputs.colwise().maxCoeff() - inputs.colwise().minCoeff();
  emulated.missed_ =
      emulated.whole_.leave_one_out().error.squaredNorm() / static_cast<double>(used);
  emulated.explained_ =
      IsRounding(variance, std::abs(average)) ? kNoIndex : 1 - emulated.missed_ / variance;
  if (emulated.whole_.constant() || !(emulated.explained_ >= kLeastExplained)) return emulated;
  for (int fold = 0; fold < options.folds; ++fold) {
    std::vector<Index> kept;
    for (Index i = 0; i < used; ++i) {
      if (i % options.folds != fold) kept.push_back(i);
    }
    ASSIGN_OR_RETURN(auto part, GaussianProcess::Fit(inputs(kept, Eigen::all), values(kept),
                                                     {.like = &emulated.whole_}));
    emulated.parts_.push_back(std::move(part));
  }
  return emulated;
}

OutputSensitivity EmulatedOutput::Over(const JointPrior& priors, const RankedPoints& points,
                                       std::span<const Eigen::MatrixXd> sets) const {
  const bool out_of_reach =
      (MiddleRange(points.standard).array() > kReachOfRuns * range_.array()).any();
  if (!MayHaveIndices(priors) || out_of_reach) sets = {};
  Said whole =
      Ask(whole_, priors, points, parts_.empty() ? std::span<const Eigen::MatrixXd>() : sets);
  OutputSensitivity out{.indices = {},
                        .explained = explained_,
                        .mean = whole.mean,
                        .sd = std::hypot(whole.sd, std::sqrt(missed_)),
                        .correlation = {},
                        .correlation_error = {},
                        .out_of_reach = out_of_reach};
  if (parts_.empty() || out_of_reach) return out;
  out.correlation = std::move(whole.correlation);
  out.indices = std::move(whole.indices);

  const auto none_is_zero = [](double v) { return std::isfinite(v) ? v : 0.0; };
  const auto folds = static_cast<Index>(parts_.size());
  const auto d = static_cast<Index>(priors.size());
  Eigen::MatrixXd first(folds, d);
  Eigen::MatrixXd total(folds, d);
  Eigen::MatrixXd correlation(folds, d);
  // The jackknife needs differences between emulators alone, at the same points.
  const auto coarse = sets.first(std::min(sets.size(), kCoarseSets));
  for (Index fold = 0; fold < folds; ++fold) {
    const Said left_out = Ask(parts_[static_cast<std::size_t>(fold)], priors, points, coarse);
    if (!sets.empty()) {
      first.row(fold) = left_out.indices.first.unaryExpr(none_is_zero);
      total.row(fold) = left_out.indices.total.unaryExpr(none_is_zero);
    }
    correlation.row(fold) = left_out.correlation.unaryExpr(none_is_zero);
  }
  // From ErrorOfMean to the delete-a-group jackknife.
  const auto inflation = static_cast<double>(folds - 1);
  const auto join = [&](const Eigen::MatrixXd& parts, const Eigen::VectorXd& sampling) {
    const Eigen::VectorXd jackknife = inflation * ErrorOfMean(parts).transpose();
    return Eigen::VectorXd((jackknife.cwiseAbs2() + sampling.cwiseAbs2()).cwiseSqrt());
  };
  if (!sets.empty()) {
    out.indices.first_error = join(first, out.indices.first_error);
    out.indices.total_error = join(total, out.indices.total_error);
  }
  const Eigen::VectorXd sampling =
      (1 - out.correlation.array().square()) / std::sqrt(std::max(1.0, points.effective - 1));
  out.correlation_error = join(correlation, sampling);
  return out;
}

absl::StatusOr<std::vector<OutputSensitivity>> AnalyseSensitivity(
    const JointPrior& priors, const Eigen::MatrixXd& parameters, const Eigen::MatrixXd& outputs,
    const Eigen::MatrixXd& points, const SensitivityOptions& options) {
  if (points.cols() != static_cast<Index>(priors.size()) || points.rows() < 3) {
    return absl::InvalidArgumentError("sensitivity: points and priors do not fit.");
  }
  const RankedPoints ranked = Ranked(priors, points);
  const std::vector<Eigen::MatrixXd> sets =
      SobolSets(static_cast<int>(priors.size()), options.sobol);
  std::vector<OutputSensitivity> all;
  for (Index o = 0; o < outputs.cols(); ++o) {
    ASSIGN_OR_RETURN(const auto emulated,
                     EmulatedOutput::Fit(priors, parameters, outputs.col(o), options));
    all.push_back(emulated.Over(priors, ranked, sets));
  }
  return all;
}

}  // namespace calib::inference
