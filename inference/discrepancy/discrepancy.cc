#include "inference/discrepancy/discrepancy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Posterior mass of a grid node below which its part of the mean is rounding of a report; chosen.
constexpr double kNegligible = 1e-6;

double Matern52(double r) {
  const double s = std::sqrt(5.0) * r;
  return (1 + s + s * s / 3) * std::exp(-s);
}

std::vector<double> LogGrid(double low, double high, int count) {
  std::vector<double> grid;
  for (int i = 0; i < count; ++i) {
    const double share = count == 1 ? 0.5 : static_cast<double>(i) / (count - 1);
    grid.push_back(std::exp(std::log(low) + share * (std::log(high) - std::log(low))));
  }
  return grid;
}

absl::Status Check(const std::vector<DiscrepancyCurve>& curves, const DiscrepancyOptions& o) {
  if (curves.empty()) return absl::InvalidArgumentError("a discrepancy needs at least one curve.");
  for (std::size_t c = 0; c < curves.size(); ++c) {
    const DiscrepancyCurve& curve = curves[c];
    const Index n = curve.residual.size();
    if (n < 1 || curve.path.size() != n || curve.covariance.rows() != n ||
        curve.covariance.cols() != n) {
      return absl::InvalidArgumentError(
          absl::StrCat("curve ", c, " of a discrepancy has ", n, " residuals at ",
                       curve.path.size(), " places with a covariance of ", curve.covariance.rows(),
                       " x ", curve.covariance.cols(), "."));
    }
    if (!curve.residual.allFinite() || !curve.path.allFinite() || !curve.covariance.allFinite() ||
        !(curve.scale > 0) || !std::isfinite(curve.scale)) {
      return absl::InvalidArgumentError(
          absl::StrCat("curve ", c, " of a discrepancy has to be finite, its scale positive."));
    }
  }
  if (!(o.none > 0 && o.none < 1) || !(o.least > 0 && o.least <= o.most) ||
      !(o.shortest > 0 && o.shortest <= o.longest) || o.amplitudes < 1 || o.lengths < 1 ||
      o.alike.empty() || o.most_readings < 1 ||
      std::any_of(o.alike.begin(), o.alike.end(), [](double a) { return !(a >= 0 && a < 1); })) {
    return absl::InvalidArgumentError(
        "options of a discrepancy: 0 < none < 1, 0 < least <= most, 0 < shortest <= longest, alike "
        "in [0, 1), counts at least 1.");
  }
  return absl::OkStatus();
}

// At most `most` of n, first and last included.
std::vector<Index> Spread(Index n, int most) {
  std::vector<Index> kept;
  if (n <= most) {
    for (Index i = 0; i < n; ++i) kept.push_back(i);
  } else {
    for (int k = 0; k < most; ++k) kept.push_back(most == 1 ? n / 2 : k * (n - 1) / (most - 1));
  }
  return kept;
}

}  // namespace

Eigen::MatrixXd Discrepancy::Kernel(const Basis& basis, int curve, const Eigen::VectorXd& path,
                                    double scale) const {
  Eigen::MatrixXd kernel(path.size(), path_.size());
  for (Index i = 0; i < path.size(); ++i) {
    for (Index j = 0; j < path_.size(); ++j) {
      const double alike = curve_[static_cast<std::size_t>(j)] == curve ? 1.0 : basis.alike;
      kernel(i, j) =
          scale * scale_[j] * alike * Matern52(std::abs(path[i] - path_[j]) / basis.length);
    }
  }
  return kernel;
}

absl::StatusOr<Discrepancy> Discrepancy::Fit(std::vector<DiscrepancyCurve> curves,
                                             const DiscrepancyOptions& options) {
  RETURN_IF_ERROR(Check(curves, options));
  Discrepancy fit;
  Index n = 0;
  double travelled = 0;
  for (DiscrepancyCurve& curve : curves) {
    const std::vector<Index> kept = Spread(curve.residual.size(), options.most_readings);
    curve.covariance = Eigen::MatrixXd(curve.covariance(kept, kept));
    curve.residual = Eigen::VectorXd(curve.residual(kept));
    curve.path = Eigen::VectorXd(curve.path(kept));
    travelled = std::max(travelled, curve.path.maxCoeff() - std::min(0.0, curve.path.minCoeff()));
    n += curve.residual.size();
  }
  if (!(travelled > 0)) travelled = 1;
  fit.path_.resize(n);
  fit.scale_.resize(n);
  Eigen::VectorXd residual(n);
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Zero(n, n);  // C^(-1/2), lower
  for (Index at = 0, c = 0; c < static_cast<Index>(curves.size()); ++c) {
    const DiscrepancyCurve& curve = curves[static_cast<std::size_t>(c)];
    const Index m = curve.residual.size();
    const Eigen::LLT<Eigen::MatrixXd> factor(curve.covariance);
    if (factor.info() != Eigen::Success) {
      return absl::InvalidArgumentError(
          absl::StrCat("the covariance of curve ", c, " is not positive definite."));
    }
    inverse.block(at, at, m, m) = LowerSolved(factor, Eigen::MatrixXd::Identity(m, m));
    fit.path_.segment(at, m) = curve.path;
    fit.scale_.segment(at, m).setConstant(curve.scale);
    residual.segment(at, m) = curve.residual;
    fit.curve_.insert(fit.curve_.end(), static_cast<std::size_t>(m), static_cast<int>(c));
    at += m;
  }
  const Eigen::VectorXd white = inverse * residual;
  fit.amplitudes_ = LogGrid(options.least, options.most, options.amplitudes);
  const std::vector<double> lengths =
      LogGrid(options.shortest * travelled, options.longest * travelled, options.lengths);
  const std::vector<double> alikes = curves.size() > 1 ? options.alike : std::vector<double>{0};
  // ln of marginal likelihood over that of none, per node [Rasmussen & Williams 2006, Eq. 2.30].
  double largest = -std::numeric_limits<double>::infinity();
  for (const double length : lengths) {
    for (const double alike : alikes) {
      Basis basis{.length = length, .alike = alike, .back = {}, .lambda = {}, .z = {}, .mass = {}};
      Eigen::MatrixXd kernel(n, n);
      for (Index i = 0; i < n; ++i) {
        kernel.row(i) = fit.Kernel(basis, fit.curve_[static_cast<std::size_t>(i)],
                                   fit.path_.segment(i, 1), fit.scale_[i]);
      }
      kernel = (inverse * kernel * inverse.transpose()).eval();
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(kernel);
      if (solver.info() != Eigen::Success) {
        return absl::InvalidArgumentError("the covariance of a discrepancy has no eigenvalues.");
      }
      basis.lambda = solver.eigenvalues().cwiseMax(0.0);
      basis.back = inverse.transpose() * solver.eigenvectors();
      basis.z = solver.eigenvectors().transpose() * white;
      for (const double a : fit.amplitudes_) {
        const Eigen::ArrayXd grown = 1 + a * a * basis.lambda.array();
        basis.mass.push_back(
            0.5 * ((basis.z.array().square() * (1 - 1 / grown)).sum() - grown.log().sum()));
        largest = std::max(largest, basis.mass.back());
      }
      fit.bases_.push_back(std::move(basis));
    }
  }
  const auto nodes = static_cast<double>(fit.bases_.size() * fit.amplitudes_.size());
  double sum = 0;
  for (Basis& basis : fit.bases_) {
    for (double& mass : basis.mass) sum += mass = std::exp(mass - largest);
  }
  fit.log_bayes_factor_ = std::log(sum / nodes) + largest;
  const double odds = fit.log_bayes_factor_ + std::log1p(-options.none) - std::log(options.none);
  fit.probability_ = odds > 0 ? 1 / (1 + std::exp(-odds)) : std::exp(odds) / (1 + std::exp(odds));
  const auto moments = [&](const auto& value) {
    Moments m;
    double square = 0;
    for (const Basis& basis : fit.bases_) {
      for (std::size_t k = 0; k < basis.mass.size(); ++k) {
        const double v = value(basis, fit.amplitudes_[k]);
        m.mean += basis.mass[k] / sum * v;
        square += basis.mass[k] / sum * v * v;
      }
    }
    m.sd = std::sqrt(std::max(0.0, square - m.mean * m.mean));
    return m;
  };
  fit.log_amplitude_ = moments([](const Basis&, double a) { return std::log(a); });
  fit.log_length_ = moments([](const Basis& basis, double) { return std::log(basis.length); });
  fit.alike_ = moments([](const Basis& basis, double) { return basis.alike; });
  for (Basis& basis : fit.bases_) {
    for (double& mass : basis.mass) mass *= fit.probability_ / sum;
  }
  return fit;
}

DiscrepancyBand Discrepancy::At(int curve, const Eigen::VectorXd& path, double scale) const {
  const Index m = path.size();
  Eigen::ArrayXd first = Eigen::ArrayXd::Zero(m);
  Eigen::ArrayXd second = Eigen::ArrayXd::Zero(m);
  for (const Basis& basis : bases_) {
    if (*std::max_element(basis.mass.begin(), basis.mass.end()) < kNegligible) continue;
    const Eigen::MatrixXd across = Kernel(basis, curve, path, scale) * basis.back;
    for (std::size_t k = 0; k < basis.mass.size(); ++k) {
      const double a2 = amplitudes_[k] * amplitudes_[k];
      const Eigen::VectorXd gain = (a2 / (1 + a2 * basis.lambda.array())).matrix();
      const Eigen::ArrayXd mean = (across * gain.cwiseProduct(basis.z)).array();
      const Eigen::ArrayXd variance =
          (a2 * (scale * scale - (across.cwiseAbs2() * gain).array())).max(0.0);
      first += basis.mass[k] * mean;
      second += basis.mass[k] * (mean.square() + variance);
    }
  }
  return {.mean = first.matrix(),
          .sd = (second - first.square()).max(0.0).sqrt().matrix(),
          .rms = second.sqrt().matrix()};
}

}  // namespace calib::inference
