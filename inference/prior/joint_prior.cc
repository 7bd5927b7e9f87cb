#include "inference/prior/joint_prior.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/standard_normal.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kLeastMass = 1e-4;  // chosen: redrawing a point takes ten thousand draws there
// Pivot of the correlation's Cholesky factor; chosen: a parameter that others determine to a part
// in a million is a copy of them.
constexpr double kLeastPivot = 1e-6;
// Error of the share inside the constraints over that share; chosen: so many nats is the evidence
// off, little beside the weights' own error.
constexpr double kMassTolerance = 1e-3;
constexpr int kMassSets = 16;              // independent scrambles: their spread is the error
constexpr int kFewestMassPoints = 1 << 9;  // of a set, at first
constexpr int kMostMassPoints = 1 << 15;   // of a set, at last
// Largest normal score, Phi^-1(1 - 1e-16): a bound is a set of measure zero with an infinite score.
constexpr double kFarthest = 8.2;

}  // namespace

absl::StatusOr<JointPrior> JointPrior::Create(std::vector<Prior> marginals,
                                              Eigen::MatrixXd correlation,
                                              std::vector<LinearConstraint> constraints,
                                              std::vector<MemberBounds> members) {
  JointPrior prior(std::move(marginals));
  const auto d = static_cast<Index>(prior.size());
  RETURN_IF_ERROR(prior.Validate());
  if (correlation.size() > 0) {
    const bool shaped = correlation.rows() == d && correlation.cols() == d &&
                        correlation.allFinite() && correlation.isApprox(correlation.transpose()) &&
                        correlation.diagonal().isApprox(Eigen::VectorXd::Ones(d));
    const Eigen::LLT<Eigen::MatrixXd> factor(correlation);
    if (!shaped || factor.info() != Eigen::Success ||
        factor.matrixLLT().diagonal().minCoeff() < kLeastPivot) {
      return absl::InvalidArgumentError(
          "the correlations of the prior contradict each other: their matrix is not positive "
          "definite.");
    }
    if (!correlation.isIdentity(0.0)) {
      prior.cholesky_ = factor.matrixL();
      prior.log_determinant_ = 2 * prior.cholesky_.diagonal().array().log().sum();
      prior.correlation_ = std::move(correlation);
    }
  }
  for (const LinearConstraint& constraint : constraints) {
    if (constraint.coefficients.size() != d || !constraint.coefficients.allFinite() ||
        std::isnan(constraint.limit)) {
      return absl::InvalidArgumentError(
          absl::StrCat("a constraint of the prior has ", constraint.coefficients.size(),
                       " coefficients; there are ", d, " parameters, and all must be numbers."));
    }
  }
  for (const MemberBounds& member : members) {
    const Index least = std::min({member.common, member.spread, member.score});
    const Index most = std::max({member.common, member.spread, member.score});
    if (least < 0 || most >= d || !(member.min <= member.max)) {
      return absl::InvalidArgumentError(
          absl::StrCat("a member of a population has bounds from ", member.min, " to ", member.max,
                       " and parameters ", least, " to ", most, " of ", d,
                       "; the bounds must be ordered and the parameters there."));
    }
  }
  prior.constraints_ = std::move(constraints);
  prior.members_ = std::move(members);
  prior.MeasureMass();
  if (!(prior.log_mass_ > std::log(kLeastMass))) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the constraints leave a share of ", std::exp(prior.log_mass_), " of the prior; at least ",
        kLeastMass, " is needed: loosen them or move the priors."));
  }
  return prior;
}

void JointPrior::MeasureMass() {
  if (!is_constrained()) return;
  const auto d = static_cast<int>(size());
  // Row i of a Sobol set does not depend on its size, so a larger set continues the smaller one.
  for (int points = kFewestMassPoints;; points *= 2) {
    Eigen::VectorXd shares(kMassSets);
    for (int set = 0; set < kMassSets; ++set) {
      const Eigen::MatrixXd unit = ScrambledSobol(points, d, static_cast<std::uint64_t>(set));
      int inside = 0;
      for (int i = 0; i < points; ++i) inside += MeetsConstraints(FromUnit(unit.row(i))) ? 1 : 0;
      shares[set] = static_cast<double>(inside) / points;
    }
    const double share = shares.mean();
    const double error =
        std::sqrt((shares.array() - share).square().sum() / (kMassSets * (kMassSets - 1.0)));
    log_mass_ = std::log(share);
    mass_error_ = share > 0 ? error / share : kInfinity;
    if (mass_error_ <= kMassTolerance || points >= kMostMassPoints || share == 0) return;
  }
}

absl::Status JointPrior::Validate() const {
  for (const Prior& prior : marginals_) {
    RETURN_IF_ERROR(prior.Validate());
  }
  return absl::OkStatus();
}

bool JointPrior::MeetsConstraints(const Eigen::VectorXd& x) const {
  const auto inside = [&x](const MemberBounds& m) {
    const double value = x[m.common] + x[m.spread] * x[m.score];
    return m.min <= value && value <= m.max;
  };
  if (!std::all_of(members_.begin(), members_.end(), inside)) return false;
  return std::all_of(constraints_.begin(), constraints_.end(), [&x](const LinearConstraint& c) {
    double sum = 0;
    for (Index j = 0; j < c.coefficients.size(); ++j) sum += c.coefficients[j] * x[j];
    return sum <= c.limit;
  });
}

bool JointPrior::InSupport(const Eigen::VectorXd& x) const {
  for (std::size_t j = 0; j < size(); ++j) {
    if (!marginals_[j].InSupport(x[static_cast<Index>(j)])) return false;
  }
  return MeetsConstraints(x);
}

// -1/2 ln |R| - 1/2 (|L^-1 z|^2 - |z|^2)
double JointPrior::LogCopula(const Eigen::VectorXd& x) const {
  if (is_independent()) return 0;
  Eigen::VectorXd z(correlation_.rows());
  for (Index j = 0; j < z.size(); ++j) {
    z[j] = marginals_[static_cast<std::size_t>(j)].NormalScore(x[j]);
    z[j] = std::clamp(z[j], -kFarthest, kFarthest);
  }
  const Eigen::VectorXd whitened = cholesky_.triangularView<Eigen::Lower>().solve(z);
  return -0.5 * (log_determinant_ + whitened.squaredNorm() - z.squaredNorm());
}

double JointPrior::LogDensity(const Eigen::VectorXd& x) const {
  if (!InSupport(x)) return -kInfinity;
  double sum = 0;
  for (std::size_t j = 0; j < size(); ++j)
    sum += marginals_[j].LogDensity(x[static_cast<Index>(j)]);
  return is_independent() && !is_constrained() ? sum : sum + LogCopula(x) - log_mass_;
}

double JointPrior::LogStandardDensity(const Eigen::VectorXd& x) const {
  if (!InSupport(x)) return -kInfinity;
  double sum = 0;
  for (std::size_t j = 0; j < size(); ++j) {
    const double value = x[static_cast<Index>(j)];
    sum += marginals_[j].LogDensity(value) - marginals_[j].LogJacobian(value);
  }
  return is_independent() && !is_constrained() ? sum : sum + LogCopula(x) - log_mass_;
}

Eigen::VectorXd JointPrior::ToStandard(const Eigen::VectorXd& x) const {
  Eigen::VectorXd s(x.size());
  for (Index j = 0; j < x.size(); ++j)
    s[j] = marginals_[static_cast<std::size_t>(j)].ToStandard(x[j]);
  return s;
}

Eigen::VectorXd JointPrior::FromStandard(const Eigen::VectorXd& s) const {
  Eigen::VectorXd x(s.size());
  for (Index j = 0; j < s.size(); ++j)
    x[j] = marginals_[static_cast<std::size_t>(j)].FromStandard(s[j]);
  return x;
}

Eigen::VectorXd JointPrior::FromUnit(const Eigen::VectorXd& u) const {
  Eigen::VectorXd x(u.size());
  const Index tied = correlation_.rows();
  if (tied > 0) {
    Eigen::VectorXd z(tied);
    for (Index j = 0; j < tied; ++j) z[j] = NormalQuantile(u[j]);
    z = (cholesky_.triangularView<Eigen::Lower>() * z).eval();
    for (Index j = 0; j < tied; ++j)
      x[j] = marginals_[static_cast<std::size_t>(j)].FromNormalScore(z[j]);
  }
  for (Index j = tied; j < u.size(); ++j)
    x[j] = marginals_[static_cast<std::size_t>(j)].Quantile(u[j]);
  return x;
}

Eigen::VectorXd JointPrior::Draw(PhiloxStream& stream) const {
  Eigen::VectorXd u(static_cast<Index>(size()));
  for (;;) {  // ends: Create refuses constraints that leave next to nothing
    for (double& value : u) value = stream.Uniform();
    Eigen::VectorXd x = FromUnit(u);
    if (MeetsConstraints(x)) return x;
  }
}

JointPrior JointPrior::With(std::span<const Prior> further) const {
  JointPrior longer = *this;
  longer.marginals_.insert(longer.marginals_.end(), further.begin(), further.end());
  return longer;
}

JointPrior JointPrior::Of(std::span<const Index> indices) const {
  assert(is_independent() && !is_constrained());
  std::vector<Prior> some;
  for (const Index j : indices) some.push_back(marginals_[static_cast<std::size_t>(j)]);
  return some;
}

}  // namespace calib::inference
