// The proposal of the next iteration from what has been computed so far.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/filter/ensemble.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/joint_states.h"
#include "inference/mixture/dirichlet_mixture.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/standard_normal.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

constexpr double kInsignificantShare = 1e-3;  // of the weight, in the lightest samples; chosen
constexpr double kNegligibleWeight = 1e-4;    // of a component: no sample is drawn from it; chosen
// Effective samples that the draws of an emulator count as; chosen: they know no more than its
// runs.
constexpr double kWorthOfDraws = 100;
// Factor on the sd of such draws; chosen: an emulator is good inside its runs only.
constexpr double kWidening = 2;
constexpr double kPerComponent = 10;   // effective samples [Cheng 2019, sec. 3.5.3: K_max = N / 10]
constexpr double kPerParameter = 2;    // effective samples; chosen: fewer follow single samples
constexpr double kMostTempered = 0.5;  // share of all samples that is asked for at most; chosen
constexpr int kRegionPoints = 1 << 14;  // of a component: its mass to 1e-3, as the header states

// Indices, ascending, of the samples that matter: the lightest, which hold a thousandth of the
// weight together and are often most of the samples, are left out. It costs the proposal nothing
// and the importance weights stay exact.
std::vector<Eigen::Index> Significant(const Eigen::VectorXd& log_weights) {
  std::vector<Eigen::Index> order(log_weights.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return log_weights[a] < log_weights[b]; });
  double left_out = 0;
  std::size_t first = 0;
  while (first + 1 < order.size()) {
    left_out += std::exp(log_weights[order[first]]);
    if (left_out > kInsignificantShare) break;
    ++first;
  }
  std::vector<Eigen::Index> significant(order.begin() + static_cast<std::ptrdiff_t>(first),
                                        order.end());
  std::sort(significant.begin(), significant.end());
  return significant;
}

struct StandardPoints {
  WeightedPoints weighted;
  std::vector<Eigen::Index> samples;  // the row of each point among all samples
};

// Samples with weight, in standard coordinates, standing for as many observations as they are
// worth: the counts sum to the effective sample size, not to a multiple of N as copies would.
//                                                                          [Cheng 2019, footnote 1]
StandardPoints Standardized(const JointPrior& priors, const std::vector<Eigen::Index>& columns,
                            const Eigen::MatrixXd& parameters, const Eigen::VectorXd& log_weights) {
  const double ess = EffectiveSampleSize(log_weights);
  std::vector<Eigen::Index> counted = Significant(log_weights);
  const auto d = static_cast<Eigen::Index>(columns.size());
  WeightedPoints data{.points = Eigen::MatrixXd(d, counted.size()),
                      .counts = Eigen::VectorXd(counted.size())};
  for (std::size_t k = 0; k < counted.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    data.counts[column] = ess * std::exp(log_weights[counted[k]]);
    for (Eigen::Index j = 0; j < d; ++j) {
      const Eigen::Index from = columns[static_cast<std::size_t>(j)];
      data.points(j, column) =
          priors[static_cast<std::size_t>(from)].ToStandard(parameters(counted[k], from));
    }
  }
  return {.weighted = std::move(data), .samples = std::move(counted)};
}

// Predictions of some of the ensemble's samples, ascending; each in units of its reading's error.
Eigen::MatrixXd StatesOf(const Ensemble& ensemble, const std::vector<Eigen::Index>& samples,
                         const DataSet& data, const FilterOptions& options) {
  const DataSet& errors =
      options.noise == NoiseMode::kEssTarget ? WithRelativeErrors(data, *ensemble.sigma) : data;
  Eigen::RowVectorXd inverse_sd(errors.readings.size());
  for (Eigen::Index t = 0; t < inverse_sd.size(); ++t)
    inverse_sd[t] = 1 / errors.readings[static_cast<std::size_t>(t)].sd;
  Eigen::MatrixXd states(samples.size(), inverse_sd.size());
  std::size_t k = 0;
  Eigen::Index first = 0;
  for (const Iteration& iteration : ensemble.used) {
    const Eigen::Index end = first + iteration.predictions.rows();
    for (; k < samples.size() && samples[k] < end; ++k) {
      states.row(static_cast<Eigen::Index>(k)) =
          iteration.predictions.row(samples[k] - first).cwiseProduct(inverse_sd);
    }
    first = end;
  }
  return states;
}

// The exponent of the likelihood that leaves enough samples to fit to: the target's share of one
// iteration, but no fewer than two per parameter.
double TemperingExponent(const FilterOptions& options, const Ensemble& ensemble) {
  if (options.noise == NoiseMode::kEssTarget) return 1;
  const double wanted = std::max(options.ess_target * static_cast<double>(ensemble.last_size),
                                 kPerParameter * static_cast<double>(ensemble.parameters.cols()));
  return FindExponent({.log_start = ensemble.log_start,
                       .log_likelihood = ensemble.log_likelihood,
                       .target = std::min(
                           wanted, kMostTempered * static_cast<double>(ensemble.log_start.size())),
                       .max_exponent = 1})
      .exponent;
}

Eigen::VectorXd TemperedLogWeights(const Ensemble& ensemble, double exponent) {
  Eigen::VectorXd result(ensemble.log_start.size());
  for (Eigen::Index i = 0; i < result.size(); ++i) {
    const bool counts =
        ensemble.log_start[i] > -kInfinity && ensemble.log_likelihood[i] > -kInfinity;
    result[i] = counts ? ensemble.log_start[i] + exponent * ensemble.log_likelihood[i] : -kInfinity;
  }
  return NormalizedLogWeights(result);
}

// As many components as there are enough effective samples for.
int MostComponents(const FilterOptions& options, const WeightedPoints& points) {
  const double least_size =
      std::max(kPerComponent, kPerParameter * static_cast<double>(points.points.rows()));
  const int affordable = static_cast<int>(points.counts.sum() / least_size);
  return std::clamp(affordable, 1, options.max_components);
}

absl::StatusOr<Proposal> FitMixture(const FilterOptions& options, const WeightedPoints& points,
                                    std::size_t iterations) {
  ASSIGN_OR_RETURN(const auto mixture,
                   FitDirichletMixture(points, {.max_components = MostComponents(options, points),
                                                .concentration = options.concentration,
                                                .seed = options.seed,
                                                .stream = iterations}));
  Proposal proposal;
  proposal.components = mixture.Predictive(kNegligibleWeight);
  proposal.defensive_share = options.defensive_share;
  return proposal;
}

// Why no mixture can be fitted to so few samples that matter, and what would help.
absl::Status TooFew(const Ensemble& ensemble, std::size_t significant, std::size_t free) {
  Eigen::Index with_weight = 0;
  for (Eigen::Index i = 0; i < ensemble.log_start.size(); ++i) {
    with_weight += ensemble.log_start[i] > -kInfinity && ensemble.log_likelihood[i] > -kInfinity;
  }
  std::string text = absl::StrCat(
      "no next iteration can be proposed: of ", ensemble.log_start.size(), " samples ", with_weight,
      with_weight == 1 ? " has" : " have", " weight, nearly all of it in ", significant, ", and ",
      free, free == 1 ? " parameter needs" : " parameters need", " more than ", free,
      " that differ. ");
  if (ensemble.diverged > 0) {
    absl::StrAppend(&text, ensemble.diverged,
                    " did not come to their ends (`calibctl samples` says why): narrow the priors "
                    "to where the model runs. ");
  }
  if (ensemble.outside > 0) {
    absl::StrAppend(&text, ensemble.outside, " lie outside the priors: widen them. ");
  }
  return absl::FailedPreconditionError(
      absl::StrCat(text, "Run more samples, or state larger errors of the readings."));
}

// Parameters that are not held.
std::vector<Eigen::Index> FreeOf(const JointPrior& priors,
                                 const std::vector<std::optional<double>>& frozen) {
  std::vector<Eigen::Index> free;
  for (std::size_t j = 0; j < priors.size(); ++j) {
    if (frozen.empty() || !frozen[j]) free.push_back(static_cast<Eigen::Index>(j));
  }
  return free;
}

// What is held, and the mass that is inside the support of the rest.
void Complete(const JointPrior& priors, const std::vector<Eigen::Index>& free,
              const std::vector<std::optional<double>>& frozen, Proposal& proposal) {
  if (free.size() < priors.size()) {
    proposal.frozen = frozen;
    proposal.log_acceptance = LogMassInSupport(proposal.components, priors.Of(free));
  } else {
    proposal.log_acceptance = LogMassInSupport(proposal.components, priors);
  }
}

}  // namespace

absl::StatusOr<double> GuidingExponent(const JointPrior& priors, const DataSet& data,
                                       const FilterOptions& options,
                                       std::span<const Iteration> iterations) {
  ASSIGN_OR_RETURN(const auto ensemble, MakeEnsemble(priors, data, options, iterations));
  return TemperingExponent(options, ensemble);
}

namespace {

// ln of the mass of the mixture where the support is more than a box.
double LogMassInRegion(std::span<const MixtureComponent> components, const JointPrior& priors) {
  const auto d = static_cast<int>(priors.size());
  const Eigen::MatrixXd unit = ScrambledSobol(kRegionPoints, d, 0);
  Eigen::VectorXd z(d);
  double total = 0;
  double inside = 0;
  for (const MixtureComponent& component : components) {
    const Eigen::MatrixXd factor = Eigen::LLT<Eigen::MatrixXd>(component.covariance).matrixL();
    int met = 0;
    for (int i = 0; i < kRegionPoints; ++i) {
      for (Eigen::Index j = 0; j < d; ++j) z[j] = NormalQuantile(unit(i, j));
      met += priors.InSupport(priors.FromStandard(component.mean + factor * z)) ? 1 : 0;
    }
    total += component.weight;
    inside += component.weight * met / kRegionPoints;
  }
  return std::log(inside / total);
}

absl::Status ValidateFrozen(const JointPrior& priors,
                            const std::vector<std::optional<double>>& frozen) {
  if (frozen.empty()) return absl::OkStatus();
  if (frozen.size() != priors.size() || !priors.is_independent() || priors.is_constrained()) {
    return absl::InvalidArgumentError(
        "parameters can be held only where the priors are independent and unconstrained, with one "
        "entry per parameter.");
  }
  bool any_free = false;
  for (std::size_t j = 0; j < frozen.size(); ++j) {
    any_free = any_free || !frozen[j];
    if (frozen[j] && !priors[j].InSupport(*frozen[j])) {
      return absl::InvalidArgumentError(
          absl::StrCat("parameter ", j, " is to be held at ", *frozen[j], ", outside its prior."));
    }
  }
  if (any_free) return absl::OkStatus();
  return absl::InvalidArgumentError("all parameters are to be held: nothing is left to infer.");
}

}  // namespace

double LogMassInSupport(std::span<const MixtureComponent> components, const JointPrior& priors) {
  if (priors.is_constrained()) return LogMassInRegion(components, priors);
  const auto d = static_cast<Eigen::Index>(priors.size());
  Eigen::VectorXd low(d);
  Eigen::VectorXd high(d);
  for (Eigen::Index j = 0; j < d; ++j) {
    const Prior& prior = priors[static_cast<std::size_t>(j)];
    const double least = prior.kind == PriorKind::kLogNormal ? std::max(prior.min, 0.0) : prior.min;
    low[j] = prior.ToStandard(least);
    high[j] = prior.ToStandard(prior.max);
  }
  return GaussianMixture(components).LogBoxMass(low, high);
}

absl::StatusOr<Proposal> FitProposal(const JointPrior& priors, const DataSet& data,
                                     const FilterOptions& options,
                                     std::span<const Iteration> iterations,
                                     const std::vector<std::optional<double>>& frozen) {
  RETURN_IF_ERROR(ValidateFrozen(priors, frozen));
  ASSIGN_OR_RETURN(const auto ensemble, MakeEnsemble(priors, data, options, iterations));
  const std::vector<Eigen::Index> free = FreeOf(priors, frozen);
  const Eigen::VectorXd log_weights =
      TemperedLogWeights(ensemble, TemperingExponent(options, ensemble));
  StandardPoints points = Standardized(priors, free, ensemble.parameters, log_weights);
  if (points.samples.size() <= free.size() || !(points.weighted.counts.sum() > 1)) {
    return TooFew(ensemble, points.samples.size(), free.size());
  }
  if (options.mixture == MixtureOver::kParametersAndStates) {
    points.weighted =
        JoinStates(points.weighted, StatesOf(ensemble, points.samples, data, options));
  }
  ASSIGN_OR_RETURN(auto proposal, FitMixture(options, points.weighted, iterations.size()));
  proposal.components =
      MarginalOfFirst(proposal.components, static_cast<Eigen::Index>(free.size()));
  Complete(priors, free, frozen, proposal);
  return proposal;
}

namespace {

// Fitted to equally weighted draws of the free parameters.
absl::StatusOr<Proposal> FitToEqual(const JointPrior& priors, const FilterOptions& options,
                                    const std::vector<Eigen::Index>& free,
                                    const Eigen::MatrixXd& draws, std::size_t iterations) {
  const auto n = static_cast<double>(draws.rows());
  const Eigen::VectorXd equal = Eigen::VectorXd::Constant(draws.rows(), -std::log(n));
  WeightedPoints points = Standardized(priors, free, draws, equal).weighted;
  points.counts *= std::min(1.0, kWorthOfDraws / points.counts.sum());
  return FitMixture(options, points, iterations);
}

}  // namespace

absl::StatusOr<Proposal> FitProposalToDraws(const JointPrior& priors, const FilterOptions& options,
                                            const Eigen::MatrixXd& draws, std::size_t iterations,
                                            const std::vector<std::optional<double>>& frozen,
                                            const Eigen::MatrixXd& closest) {
  RETURN_IF_ERROR(ValidateFrozen(priors, frozen));
  const auto d = static_cast<Eigen::Index>(priors.size());
  if (draws.rows() == 0 || draws.cols() != d || (closest.rows() > 0 && closest.cols() != d)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a proposal cannot be fitted to ", draws.rows(), " x ", draws.cols(), " draws and ",
        closest.rows(), " x ", closest.cols(), " closest of ", d, " parameters."));
  }
  const std::vector<Eigen::Index> free = FreeOf(priors, frozen);
  ASSIGN_OR_RETURN(auto proposal, FitToEqual(priors, options, free, draws, iterations));
  for (MixtureComponent& component : proposal.components) {
    component.covariance *= kWidening * kWidening;
  }
  if (closest.rows() > 0) {
    ASSIGN_OR_RETURN(auto near, FitToEqual(priors, options, free, closest, iterations));
    for (MixtureComponent& component : proposal.components) component.weight *= 0.5;
    for (MixtureComponent& component : near.components) {
      component.weight *= 0.5;
      proposal.components.push_back(std::move(component));
    }
  }
  Complete(priors, free, frozen, proposal);
  return proposal;
}

}  // namespace calib::inference
