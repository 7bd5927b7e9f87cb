#include "server/diagnosis/base_region.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/diagnosis/diagnosis_set.h"
#include "inference/numerics/log_weights.h"
#include "inference/sampling/sobol.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

constexpr double kTenTimesAsWide = 0.01;  // power of a normal likelihood that makes it so
constexpr double kRunsThatCount = 10;     // of the base, by their tempered weights
constexpr double kHalfBox = 4;            // sd of the tempered posterior to each side
constexpr int kNet = 4096;                // points over the box
constexpr int kDraws = 256;               // of the tempered posterior

// Base runs as a set without effects, on these axes.
inference::SetRuns WithoutRace(const BaseRuns& base, const BaseAxes& axes) {
  const DesignRows rows(axes, Race{.base = std::vector<std::string>(axes.priors.size())}, {});
  return SetRunsOf(base, rows, {}, {});
}

// ln of likelihood and prior at scaled points of the box.
struct BaseFit {
  inference::DiagnosisSet set;
  Eigen::VectorXd z;

  Eigen::VectorXd LogLikelihood(const Eigen::MatrixXd& scaled) const {
    const inference::DesignPoints points{.base = scaled,
                                         .strength = Eigen::MatrixXd(scaled.rows(), 0),
                                         .shape = Eigen::MatrixXd(scaled.rows(), 0)};
    return set.LogDensity(z, points);
  }
};

Eigen::MatrixXd NetOver(Index d) {
  return (2 * inference::ScrambledSobol(kNet, static_cast<int>(d), 0).array() - 1).matrix();
}

// Points of the net, evenly through the weights.
Eigen::MatrixXd Resampled(const Eigen::MatrixXd& net, const Eigen::VectorXd& log_weights) {
  Eigen::MatrixXd draws(kDraws, net.cols());
  const Eigen::VectorXd weights = inference::NormalizedLogWeights(log_weights).array().exp();
  double cumulated = 0;
  Index count = 0;
  for (Index i = 0; i < net.rows(); ++i) {
    cumulated += weights[i] * kDraws;
    while (count < kDraws && static_cast<double>(count) + 0.5 < cumulated)
      draws.row(count++) = net.row(i);
  }
  for (; count < kDraws; ++count) draws.row(count) = draws.row(count - 1);  // rounding alone
  return draws;
}

}  // namespace

Eigen::VectorXd LogBasePrior(const inference::JointPrior& prior, const BaseAxes& axes,
                             const Eigen::MatrixXd& scaled) {
  const Eigen::MatrixXd values = axes.Values(scaled);
  Eigen::VectorXd result(scaled.rows());
  for (Index i = 0; i < result.size(); ++i)
    result[i] = prior.LogStandardDensity(values.row(i).transpose());
  return result;
}

absl::StatusOr<BaseRegion> RegionOf(const BaseRuns& base, const inference::JointPrior& prior) {
  const Index n = base.values.rows(), d = base.values.cols();
  const int fewest = FewestBaseRuns(static_cast<int>(d));
  if (n < fewest) {
    return absl::FailedPreconditionError(absl::StrCat(
        n,
        " runs of the campaign came to their ends; which effect is missing is asked of an "
        "emulator, and of ",
        d, d == 1 ? " parameter" : " parameters", " it takes ", fewest,
        " runs: raise `samples` or `max_iterations`"));
  }
  BaseRegion region{.axes = AxesOver({prior.begin(), prior.end()}, base.values)};
  const Eigen::MatrixXd net = NetOver(d);
  // Twice, since an emulator of the narrower box knows it better.
  for (const bool last : {false, true}) {
    ASSIGN_OR_RETURN(inference::DiagnosisSet set,
                     inference::DiagnosisSet::Fit(WithoutRace(base, region.axes)));
    if (set.coordinates()->count() <= d) {
      return absl::FailedPreconditionError(absl::StrCat("the fitted curves have ",
                                                        set.coordinates()->count(),
                                                        " shapes that can be told apart, "
                                                        "and ",
                                                        d, d == 1 ? " parameter" : " parameters",
                                                        " may take them all: give longer curves "
                                                        "or more tests"));
    }
    BaseFit fit{.set = std::move(set), .z = {}};
    fit.z = fit.set.coordinates()->Of(Eigen::MatrixXd::Zero(1, base.histories.cols())).row(0);
    const Eigen::MatrixXd scaled = region.axes.Scaled(base.values);
    std::vector<Index> inside;
    for (Index i = 0; i < n; ++i) {
      if (scaled.row(i).cwiseAbs().maxCoeff() <= 1 + 1e-9) inside.push_back(i);
    }
    const Eigen::VectorXd of_runs = fit.LogLikelihood(scaled(inside, Eigen::all));
    region.power = kTenTimesAsWide;
    while (inference::EffectiveSampleSize(region.power * of_runs) < kRunsThatCount)
      region.power /= 2;
    const Eigen::VectorXd log_weights =
        region.power * fit.LogLikelihood(net) + LogBasePrior(prior, region.axes, net);
    region.draws = Resampled(net, log_weights);
    region.centre = region.draws.colwise().mean();
    if (last) break;
    const Eigen::VectorXd sd =
        ((region.draws.rowwise() - region.centre.transpose()).colwise().squaredNorm() / kDraws)
            .cwiseSqrt();
    const Eigen::VectorXd low = (region.centre - kHalfBox * sd).cwiseMax(-1);
    const Eigen::VectorXd high = (region.centre + kHalfBox * sd).cwiseMin(1);
    Index left = 0;
    for (const Index i : inside) {
      const Eigen::VectorXd x = scaled.row(i);
      left += (x.array() >= low.array()).all() && (x.array() <= high.array()).all() ? 1 : 0;
    }
    if (left < Index{2} * fewest || ((high - low).array() <= 0).any()) break;
    region.axes = region.axes.Narrowed(low, high);
  }
  const Eigen::MatrixXd scaled = region.axes.Scaled(base.values);
  (scaled.rowwise() - region.centre.transpose()).rowwise().squaredNorm().minCoeff(&region.nearest);
  return region;
}

}  // namespace calib::diagnosis
