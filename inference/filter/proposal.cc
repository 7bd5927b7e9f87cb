// Drawing samples and the density they were drawn from.

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/log_weights.h"
#include "inference/sampling/halton.h"
#include "inference/sampling/latin_hypercube.h"
#include "inference/sampling/philox.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLeastAcceptance = 1e-3;
constexpr int kMostRedraws = 100'000;  // below 1e-43 of ever being reached at that acceptance

bool InSupport(std::span<const Prior> priors, const Eigen::VectorXd& x) {
  for (std::size_t j = 0; j < priors.size(); ++j) {
    if (!priors[j].InSupport(x[static_cast<Eigen::Index>(j)])) return false;
  }
  return true;
}

Eigen::VectorXd ToStandard(std::span<const Prior> priors, const Eigen::VectorXd& x) {
  Eigen::VectorXd s(x.size());
  for (Eigen::Index j = 0; j < x.size(); ++j) s[j] = priors[j].ToStandard(x[j]);
  return s;
}

Eigen::VectorXd FromStandard(std::span<const Prior> priors, const Eigen::VectorXd& s) {
  Eigen::VectorXd x(s.size());
  for (Eigen::Index j = 0; j < s.size(); ++j) x[j] = priors[j].FromStandard(s[j]);
  return x;
}

double LogPrior(std::span<const Prior> priors, const Eigen::VectorXd& x) {
  double sum = 0;
  for (std::size_t j = 0; j < priors.size(); ++j)
    sum += priors[j].LogDensity(x[static_cast<Eigen::Index>(j)]);
  return sum;
}

// One sample of (1 - share) mixture, truncated, + share prior; false when the mixture never meets
// the support.
bool DrawOne(const GaussianMixture& mixture, double defensive_share, std::span<const Prior> priors,
             PhiloxStream& stream, Eigen::VectorXd& x) {
  if (stream.Uniform() < defensive_share) {
    for (std::size_t j = 0; j < priors.size(); ++j) {
      x[static_cast<Eigen::Index>(j)] = priors[j].Quantile(stream.Uniform());
    }
    return true;
  }
  for (int attempt = 0; attempt < kMostRedraws; ++attempt) {
    x = FromStandard(priors, mixture.Draw(stream));
    if (InSupport(priors, x)) return true;
  }
  return false;
}

// The design of the first iteration in the unit cube, n x d.
absl::StatusOr<Eigen::MatrixXd> UnitDesign(const FilterOptions& options, int n, int d) {
  if (options.design == Design::kHalton) return Halton(n, d);
  if (options.design == Design::kSobol) return ScrambledSobol(n, d, options.seed);
  constexpr double kMostDistances = 2e9;  // squared differences of coordinates; a few seconds
  const bool symmetric = options.design == Design::kSymmetricLatinHypercube;
  const double designs = kMostDistances / (0.5 * n * n * d);
  return LatinHypercube(
      {.points = n,
       .dimensions = d,
       .symmetric = symmetric,
       .centred = symmetric,
       .candidates = symmetric ? static_cast<int>(std::clamp(designs, 1.0, 1e3)) : 1,
       .seed = options.seed});
}

}  // namespace

absl::StatusOr<Eigen::MatrixXd> DrawSamples(const Proposal& proposal, std::span<const Prior> priors,
                                            const FilterOptions& options, int iteration, int n) {
  const auto d = static_cast<int>(priors.size());
  if (n < 1 || d < 1 || iteration < 0) {
    return absl::InvalidArgumentError(absl::StrCat(n, " samples of ", d,
                                                   " parameters in iteration ", iteration,
                                                   ": need at least one of each."));
  }
  Eigen::MatrixXd samples(n, d);
  if (proposal.components.empty()) {
    // A design may be used once only: a later iteration that falls back to the prior draws new
    // points.
    if (iteration == 0) {
      auto design = UnitDesign(options, n, d);
      if (!design.ok()) return design;
      samples = *std::move(design);
    }
    for (int i = 0; i < n; ++i) {
      PhiloxStream stream({.seed = options.seed,
                           .purpose = StreamPurpose::kProposalDraws,
                           .iteration = static_cast<std::uint64_t>(iteration),
                           .sample = static_cast<std::uint64_t>(i)});
      for (int j = 0; j < d; ++j) {
        samples(i, j) = priors[j].Quantile(iteration == 0 ? samples(i, j) : stream.Uniform());
      }
    }
    return samples;
  }
  const absl::Status barren = absl::FailedPreconditionError(absl::StrCat(
      "the mixture has a share of only ", std::exp(proposal.log_acceptance),
      " of its mass inside the prior's support: widen the priors or start again from the prior."));
  if (proposal.log_acceptance < std::log(kLeastAcceptance)) return barren;
  const GaussianMixture mixture(proposal.components);
  Eigen::VectorXd x(d);
  for (int i = 0; i < n; ++i) {
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kProposalDraws,
                         .iteration = static_cast<std::uint64_t>(iteration),
                         .sample = static_cast<std::uint64_t>(i)});
    if (!DrawOne(mixture, proposal.defensive_share, priors, stream, x)) return barren;
    samples.row(i) = x;
  }
  return samples;
}

Eigen::VectorXd LogDensity(const Proposal& proposal, std::span<const Prior> priors,
                           const Eigen::MatrixXd& parameters) {
  const Eigen::Index n = parameters.rows();
  Eigen::VectorXd result(n);
  const bool has_mixture = !proposal.components.empty();
  const std::optional<GaussianMixture> mixture =
      has_mixture ? std::optional<GaussianMixture>(proposal.components) : std::nullopt;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd x = parameters.row(i);
    if (!InSupport(priors, x)) {
      result[i] = -kInfinity;
      continue;
    }
    const double log_prior = LogPrior(priors, x);
    if (!has_mixture) {
      result[i] = log_prior;
      continue;
    }
    double log_jacobian = 0;
    for (std::size_t j = 0; j < priors.size(); ++j) {
      log_jacobian += priors[j].LogJacobian(x[static_cast<Eigen::Index>(j)]);
    }
    const double log_mixture =
        mixture->LogDensity(ToStandard(priors, x)) + log_jacobian - proposal.log_acceptance;
    result[i] = LogSumExp(Eigen::Vector2d(std::log1p(-proposal.defensive_share) + log_mixture,
                                          std::log(proposal.defensive_share) + log_prior));
  }
  return result;
}

Eigen::VectorXd LogImportance(std::span<const Prior> priors,
                              std::span<const Iteration> iterations) {
  Eigen::Index total = 0;
  Eigen::Index known = 0;  // samples of iterations whose density can be evaluated anywhere
  for (const Iteration& iteration : iterations) {
    total += iteration.parameters.rows();
    if (!iteration.log_proposal) known += iteration.parameters.rows();
  }
  Eigen::VectorXd result(total);
  Eigen::Index row = 0;
  for (const Iteration& iteration : iterations) {
    const Eigen::Index n = iteration.parameters.rows();
    Eigen::MatrixXd log_terms(n, static_cast<Eigen::Index>(iterations.size()));
    log_terms.setConstant(-kInfinity);
    if (!iteration.log_proposal) {
      for (std::size_t k = 0; k < iterations.size(); ++k) {
        if (iterations[k].log_proposal) continue;
        const double share =
            static_cast<double>(iterations[k].parameters.rows()) / static_cast<double>(known);
        log_terms.col(static_cast<Eigen::Index>(k)) =
            LogDensity(iterations[k].proposal, priors, iteration.parameters).array() +
            std::log(share);
      }
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const double log_prior = LogPrior(priors, iteration.parameters.row(i));
      const double log_proposal =
          iteration.log_proposal ? (*iteration.log_proposal)[i] : LogSumExp(log_terms.row(i));
      result[row + i] = log_prior == -kInfinity ? -kInfinity : log_prior - log_proposal;
    }
    row += n;
  }
  return result;
}

}  // namespace calib::inference
