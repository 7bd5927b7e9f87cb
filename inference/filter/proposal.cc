// Drawing samples and the density they were drawn from.

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/filter/iterative_filter.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/sampling/halton.h"
#include "inference/sampling/latin_hypercube.h"
#include "inference/sampling/philox.h"
#include "inference/sampling/shuffle.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

constexpr double kLeastAcceptance = 1e-3;  // chosen: a thousand draws for a sample are no time
constexpr int kMostRedraws = 100'000;      // reached with a chance below 1e-43 at that acceptance
constexpr int kDesigns = 1000;             // drawn for the best of them [Samuelsson 2023, sec. 3.2]
constexpr Eigen::Index kBlock = 64;        // rows shuffled together; chosen, packings are fewer
// Points of a sequence asked for beyond those that are likely to meet the constraints; chosen: more
// are asked for where these do not do.
constexpr double kMorePoints = 1.1;
constexpr int kAtLeastMore = 16;

// One sample of (1 - share) mixture, truncated, + share prior; false when the mixture never meets
// the support.
bool DrawOne(const GaussianMixture& mixture, double defensive_share, const JointPrior& priors,
             PhiloxStream& stream, Eigen::VectorXd& x) {
  if (stream.Uniform() < defensive_share) {
    x = priors.Draw(stream);
    return true;
  }
  for (int attempt = 0; attempt < kMostRedraws; ++attempt) {
    x = priors.FromStandard(mixture.Draw(stream));
    if (priors.InSupport(x)) return true;
  }
  return false;
}

// The design of the first iteration in the unit cube, n x d.
absl::StatusOr<Eigen::MatrixXd> UnitDesign(const FilterOptions& options, int n, int d) {
  if (options.design == Design::kHalton) return Halton(n, d);
  if (options.design == Design::kSobol) return ScrambledSobol(n, d, options.seed);
  const bool symmetric = options.design == Design::kSymmetricLatinHypercube;
  return LatinHypercube({.points = n,
                         .dimensions = d,
                         .symmetric = symmetric,
                         .centred = symmetric,
                         .candidates = symmetric ? kDesigns : 1,
                         .seed = options.seed});
}

PhiloxStream DrawStream(const FilterOptions& options, int iteration, int sample) {
  return PhiloxStream({.seed = options.seed,
                       .purpose = StreamPurpose::kProposalDraws,
                       .iteration = static_cast<std::uint64_t>(iteration),
                       .sample = static_cast<std::uint64_t>(sample)});
}

// Rows shuffled within blocks (sampling/shuffle.h): sample i runs on packing i mod R, which in the
// order of a sequence would be a digit of a parameter. Whole blocks do not depend on the number of
// rows, so that a larger campaign finds the runs of a smaller one.
Eigen::MatrixXd ShuffledInBlocks(const Eigen::MatrixXd& samples, std::uint64_t seed) {
  Eigen::MatrixXd shuffled(samples.rows(), samples.cols());
  for (Eigen::Index first = 0; first < samples.rows(); first += kBlock) {
    const Eigen::Index rows = std::min(kBlock, samples.rows() - first);
    const std::vector<Eigen::Index> order =
        Shuffled(rows, PhiloxStream({.seed = seed,
                                     .purpose = StreamPurpose::kDesignOrder,
                                     .iteration = 0,
                                     .sample = static_cast<std::uint64_t>(first)}));
    shuffled.middleRows(first, rows) = samples.middleRows(first, rows)(order, Eigen::all);
  }
  return shuffled;
}

// The points of a design that meet the constraints. A sequence goes on past those that do not, so
// that it is the same whatever n; a Latin hypercube has no further points, and a draw from the
// prior takes the place of each.
absl::StatusOr<Eigen::MatrixXd> FirstSamples(const JointPrior& priors, const FilterOptions& options,
                                             int n) {
  const auto d = static_cast<int>(priors.size());
  const bool sequence = options.design == Design::kHalton || options.design == Design::kSobol;
  const double share = std::exp(priors.log_mass());
  Eigen::MatrixXd samples(n, d);
  int points = sequence && priors.is_constrained()
                   ? static_cast<int>(kMorePoints * n / share) + kAtLeastMore
                   : n;
  for (;; points *= 2) {
    ASSIGN_OR_RETURN(const auto design, UnitDesign(options, points, d));
    int filled = 0;
    for (int i = 0; i < points && filled < n; ++i) {
      Eigen::VectorXd x = priors.FromUnit(design.row(i));
      if (!priors.MeetsConstraints(x)) {
        if (sequence) continue;
        PhiloxStream stream = DrawStream(options, 0, i);
        x = priors.Draw(stream);
      }
      samples.row(filled++) = x;
    }
    if (filled == n) return ShuffledInBlocks(samples, options.seed);
  }
}

// The columns of the parameters that a proposal leaves free.
std::vector<Eigen::Index> FreeColumns(const Proposal& proposal, std::size_t parameters) {
  std::vector<Eigen::Index> free;
  for (std::size_t j = 0; j < parameters; ++j) {
    if (proposal.frozen.empty() || !proposal.frozen[j])
      free.push_back(static_cast<Eigen::Index>(j));
  }
  return free;
}

Proposal WithoutFrozen(Proposal proposal) {
  proposal.frozen.clear();
  return proposal;
}

}  // namespace

bool SameFrozen(const Proposal& a, const Proposal& b) {
  const auto any = [](const Proposal& p) {
    return std::any_of(p.frozen.begin(), p.frozen.end(),
                       [](const auto& f) { return f.has_value(); });
  };
  return any(a) == any(b) && (!any(a) || a.frozen == b.frozen);
}

absl::StatusOr<Eigen::MatrixXd> DrawSamples(const Proposal& proposal, const JointPrior& priors,
                                            const FilterOptions& options, int iteration, int n) {
  const auto d = static_cast<int>(priors.size());
  if (n < 1 || d < 1 || iteration < 0) {
    return absl::InvalidArgumentError(absl::StrCat(n, " samples of ", d,
                                                   " parameters in iteration ", iteration,
                                                   ": need at least one of each."));
  }
  if (!proposal.frozen.empty()) {
    const std::vector<Eigen::Index> free = FreeColumns(proposal, priors.size());
    ASSIGN_OR_RETURN(auto drawn,
                     DrawSamples(WithoutFrozen(proposal), priors.Of(free), options, iteration, n));
    Eigen::MatrixXd all(n, d);
    for (int j = 0; j < d; ++j) {
      const auto& held = proposal.frozen[static_cast<std::size_t>(j)];
      if (held) all.col(j).setConstant(*held);
    }
    for (std::size_t k = 0; k < free.size(); ++k)
      all.col(free[k]) = drawn.col(static_cast<Eigen::Index>(k));
    return all;
  }
  // A design may be used once only: a later iteration that falls back to the prior draws new
  // points.
  if (proposal.components.empty() && iteration == 0) return FirstSamples(priors, options, n);
  Eigen::MatrixXd samples(n, d);
  if (proposal.components.empty()) {
    for (int i = 0; i < n; ++i) {
      PhiloxStream stream = DrawStream(options, iteration, i);
      samples.row(i) = priors.Draw(stream);
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
    PhiloxStream stream = DrawStream(options, iteration, i);
    if (!DrawOne(mixture, proposal.defensive_share, priors, stream, x)) return barren;
    samples.row(i) = x;
  }
  return samples;
}

Eigen::VectorXd LogDensity(const Proposal& proposal, const JointPrior& priors,
                           const Eigen::MatrixXd& parameters) {
  if (!proposal.frozen.empty()) {
    const std::vector<Eigen::Index> free = FreeColumns(proposal, priors.size());
    return LogDensity(WithoutFrozen(proposal), priors.Of(free), parameters(Eigen::all, free));
  }
  const Eigen::Index n = parameters.rows();
  Eigen::VectorXd result(n);
  const bool has_mixture = !proposal.components.empty();
  const std::optional<GaussianMixture> mixture =
      has_mixture ? std::optional<GaussianMixture>(proposal.components) : std::nullopt;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd x = parameters.row(i);
    const double log_prior = priors.LogDensity(x);
    if (!has_mixture || log_prior == -kInfinity) {
      result[i] = log_prior;
      continue;
    }
    double log_jacobian = 0;
    for (std::size_t j = 0; j < priors.size(); ++j) {
      log_jacobian += priors[j].LogJacobian(x[static_cast<Eigen::Index>(j)]);
    }
    const double log_mixture =
        mixture->LogDensity(priors.ToStandard(x)) + log_jacobian - proposal.log_acceptance;
    result[i] = LogSumExp(Eigen::Vector2d(std::log1p(-proposal.defensive_share) + log_mixture,
                                          std::log(proposal.defensive_share) + log_prior));
  }
  return result;
}

Eigen::VectorXd LogImportance(const JointPrior& priors, std::span<const Iteration> iterations) {
  Eigen::Index total = 0;
  Eigen::Index known = 0;  // samples of iterations whose density can be evaluated anywhere
  for (const Iteration& iteration : iterations) {
    total += iteration.parameters.rows();
    if (!iteration.log_proposal) known += iteration.parameters.rows();
  }
  Eigen::VectorXd result = Eigen::VectorXd::Constant(total, -kInfinity);
  Eigen::Index row = 0;
  // Iterations that hold other parameters have no density in common with the last one.
  while (!iterations.empty() &&
         !SameFrozen(iterations.front().proposal, iterations.back().proposal)) {
    const Eigen::Index n = iterations.front().parameters.rows();
    if (!iterations.front().log_proposal) known -= n;
    row += n;
    iterations = iterations.subspan(1);
  }
  const bool held = !iterations.empty() && !iterations.back().proposal.frozen.empty();
  const std::vector<Eigen::Index> free =
      held ? FreeColumns(iterations.back().proposal, priors.size()) : std::vector<Eigen::Index>{};
  const JointPrior of_free = held ? priors.Of(free) : priors;
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
      const double log_prior = held ? of_free.LogDensity(iteration.parameters(i, free).transpose())
                                    : priors.LogDensity(iteration.parameters.row(i));
      const double log_proposal =
          iteration.log_proposal ? (*iteration.log_proposal)[i] : LogSumExp(log_terms.row(i));
      result[row + i] = log_prior == -kInfinity ? -kInfinity : log_prior - log_proposal;
    }
    row += n;
  }
  return result;
}

}  // namespace calib::inference
