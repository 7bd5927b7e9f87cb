#include "server/planning/early_stopping.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "calib/return_if_error.h"
#include "inference/sampling/philox.h"
#include "server/planning/decisions.h"

namespace calib::planning {
namespace {

constexpr double kNoMass = -std::numeric_limits<double>::infinity();

double LogSumExp(const std::vector<double>& terms) {
  double largest = kNoMass;
  for (const double term : terms) {
    largest = std::max(largest, term);
  }
  if (!std::isfinite(largest)) {
    return kNoMass;
  }
  double sum = 0;
  for (const double term : terms) {
    sum += std::exp(term - largest);
  }
  return largest + std::log(sum);
}

constexpr double kAudited = 0.02;  // of the stopped samples
constexpr double kFinishedPerEffective = 2;

struct Finished {
  double exponent = 1;                // of the likelihood in all weights
  double log_mass = 0;                // ln of the summed weight of the finished samples
  std::vector<double> log_weights{};  // of all samples in order; -inf: not finished
};

/// Of the likelihood in the weights that are bounded.
absl::StatusOr<double> ExponentOf(const Definition& definition, const History& history) {
  const auto& stopping = definition.campaign.early_stopping;
  if (stopping && stopping->exponent) {
    return *stopping->exponent;
  }
  return inference::GuidingExponent(definition.priors, definition.data, definition.campaign.filter,
                                    history.iterations);
}

/// importance: of all samples, in order.
absl::StatusOr<Finished> FinishedMass(const Definition& definition, const History& history,
                                      const Eigen::VectorXd& importance) {
  const auto exponent = ExponentOf(definition, history);
  if (absl::IsFailedPrecondition(exponent.status())) {  // no sample has weight
    return Finished{.exponent = 1, .log_mass = kNoMass};
  }
  if (!exponent.ok()) {
    return exponent.status();
  }
  std::vector<double> weights;
  Eigen::Index at = 0;
  for (const inference::Iteration& iteration : history.iterations) {
    ASSIGN_OR_RETURN(const auto likelihood,
                     inference::LogLikelihood(definition.data, definition.campaign.filter,
                                              iteration.predictions));
    for (Eigen::Index i = 0; i < likelihood.size(); ++i) {
      const bool counts = std::isfinite(likelihood(i)) && std::isfinite(importance(at));
      weights.push_back(counts ? importance(at) + *exponent * likelihood(i) : kNoMass);
      ++at;
    }
  }
  const double log_mass = LogSumExp(weights);
  return Finished{.exponent = *exponent, .log_mass = log_mass, .log_weights = std::move(weights)};
}

/// See StopThresholds. n: samples of the iteration.
double Threshold(const Definition& definition, const Finished& finished, double importance,
                 Eigen::Index n) {
  const double share = definition.campaign.early_stopping->discard_at_most / static_cast<double>(n);
  return (finished.log_mass + std::log(share) - importance) / finished.exponent;
}

}  // namespace

bool StopsEarly(const Definition& definition) {
  return definition.campaign.early_stopping.has_value() &&
         !definition.campaign.precomputed.has_value() &&
         definition.campaign.filter.noise != inference::NoiseMode::kEssTarget;
}

double FinishedWanted(const Definition& definition) {
  const campaign::Campaign& campaign = definition.campaign;
  const double share = campaign.early_stopping->exponent ? 0 : campaign.filter.ess_target;
  const double effective =
      std::max(share * campaign.samples, 2.0 * static_cast<double>(definition.priors.size()));
  return std::ceil(kFinishedPerEffective * effective);
}

absl::StatusOr<std::vector<double>> StopThresholds(const Definition& definition,
                                                   const History& history,
                                                   const inference::Iteration& next) {
  const Eigen::Index n = next.parameters.rows();
  const bool at_once = DecidesAtOnce(definition);
  std::vector<double> thresholds(static_cast<std::size_t>(n), at_once ? kNoMass : store::kUnknown);
  if (!StopsEarly(definition) || history.iterations.empty()) {
    return thresholds;
  }
  std::vector<inference::Iteration> all = history.iterations;
  all.push_back(next);
  const Eigen::VectorXd importance = inference::LogImportance(definition.priors, all);
  ASSIGN_OR_RETURN(const auto finished, FinishedMass(definition, history, importance));
  if (!std::isfinite(finished.log_mass)) {
    return thresholds;
  }
  const Eigen::Index first = importance.size() - n;
  for (Eigen::Index i = 0; i < n; ++i) {
    thresholds[static_cast<std::size_t>(i)] =
        Threshold(definition, finished, importance(first + i), n);
  }
  return thresholds;
}

absl::StatusOr<std::vector<std::pair<int, double>>> ThresholdsNow(const Definition& definition,
                                                                  const History& history) {
  std::vector<std::pair<int, double>> changed;
  const Eigen::VectorXd importance =
      inference::LogImportance(definition.priors, history.iterations);
  ASSIGN_OR_RETURN(const auto finished, FinishedMass(definition, history, importance));
  const auto done = std::count_if(finished.log_weights.begin(), finished.log_weights.end(),
                                  [](double weight) { return std::isfinite(weight); });
  if (!definition.campaign.early_stopping->exponent &&
      static_cast<double>(done) < FinishedWanted(definition)) {
    return changed;
  }
  const std::vector<char>& ended = history.ended.back();
  const auto n = static_cast<Eigen::Index>(ended.size());
  const Eigen::Index first = importance.size() - n;
  for (Eigen::Index i = 0; std::isfinite(finished.log_mass) && i < n; ++i) {
    const store::SampleRecord& sample = history.samples[static_cast<std::size_t>(first + i)];
    const double threshold = Threshold(definition, finished, importance(first + i), n);
    const bool may_stop = !std::isnan(sample.stop_below);
    if (ended[static_cast<std::size_t>(i)] == 0 && may_stop && threshold != sample.stop_below) {
      changed.emplace_back(sample.sample, threshold);
    }
  }
  return changed;
}

absl::StatusOr<Loss> StatedLoss(const Definition& definition, const History& history) {
  Loss loss;
  if (history.stopped_keys.empty()) {
    return loss;
  }
  const Eigen::VectorXd importance =
      inference::LogImportance(definition.priors, history.iterations);
  ASSIGN_OR_RETURN(const auto finished, FinishedMass(definition, history, importance));
  std::map<int, std::vector<store::EvaluationKey>> keys;
  for (const store::EvaluationKey& key : history.stopped_keys) {
    keys[key.sample].push_back(key);
  }
  struct Stopped {
    double bound;  // of the share of the finished mass that it could have had
    int sample;
  };
  std::vector<Stopped> stopped;
  std::size_t at = 0;
  for (std::size_t k = 0; k < history.iterations.size(); ++k) {
    ASSIGN_OR_RETURN(const auto bound,
                     inference::LogLikelihoodBound(definition.data, definition.campaign.filter,
                                                   history.stopped[k]));
    for (Eigen::Index i = 0; i < bound.size(); ++i, ++at) {
      const int sample = history.samples[at].sample;
      if (keys.count(sample) > 0) {
        stopped.push_back({.bound = std::exp(importance(static_cast<Eigen::Index>(at)) +
                                             finished.exponent * bound(i) - finished.log_mass),
                           .sample = sample});
      }
    }
  }
  std::stable_sort(stopped.begin(), stopped.end(),
                   [](const Stopped& a, const Stopped& b) { return a.bound < b.bound; });
  // The smallest bounds stay stopped while their sum is allowed.
  for (const Stopped& one : stopped) {
    if (loss.resume.empty() &&
        loss.stated + one.bound <= definition.campaign.early_stopping->discard_at_most) {
      loss.stated += one.bound;
      loss.bounds[one.sample] = one.bound;
    } else {
      const auto& of_sample = keys[one.sample];
      loss.resume.insert(loss.resume.end(), of_sample.begin(), of_sample.end());
    }
  }
  std::sort(loss.resume.begin(), loss.resume.end());
  return loss;
}

absl::StatusOr<double> UnknownMass(const Definition& definition, const History& history) {
  if (history.unknown.empty()) return 0;
  if (definition.campaign.filter.noise == inference::NoiseMode::kEssTarget) return store::kUnknown;
  const Eigen::VectorXd importance =
      inference::LogImportance(definition.priors, history.iterations);
  ASSIGN_OR_RETURN(const auto finished, FinishedMass(definition, history, importance));
  if (!std::isfinite(finished.log_mass)) return store::kUnknown;
  std::vector<Eigen::VectorXd> bounds;
  double best = kNoMass;  // log likelihood of those that finished
  for (std::size_t k = 0; k < history.iterations.size(); ++k) {
    ASSIGN_OR_RETURN(auto bound,
                     inference::LogLikelihoodBound(definition.data, definition.campaign.filter,
                                                   history.stopped[k]));
    bounds.push_back(std::move(bound));
    ASSIGN_OR_RETURN(const auto likelihood,
                     inference::LogLikelihood(definition.data, definition.campaign.filter,
                                              history.iterations[k].predictions));
    for (const double one : likelihood) {
      if (std::isfinite(one)) best = std::max(best, one);
    }
  }
  double mass = 0;
  std::size_t at = 0;
  for (const Eigen::VectorXd& bound : bounds) {
    for (Eigen::Index i = 0; i < bound.size(); ++i, ++at) {
      if (history.unknown.count(history.samples[at].sample) == 0) continue;
      const double most = finished.exponent * std::min(bound(i), best);
      mass += std::exp(importance(static_cast<Eigen::Index>(at)) + most - finished.log_mass);
    }
  }
  return mass;
}

std::vector<int> ToAudit(const Definition& definition, const History& history, const Loss& loss) {
  std::size_t audited = 0;
  std::vector<std::pair<double, int>> order;
  for (const store::SampleRecord& sample : history.samples) {
    if (!std::isnan(sample.audited)) {
      ++audited;
    } else if (loss.bounds.count(sample.sample) > 0) {
      inference::PhiloxStream stream({.seed = definition.campaign.seed,
                                      .purpose = inference::StreamPurpose::kAudit,
                                      .iteration = static_cast<std::uint64_t>(sample.iteration),
                                      .sample = static_cast<std::uint64_t>(sample.sample)});
      order.emplace_back(stream.Uniform(), sample.sample);
    }
  }
  const auto wanted =
      static_cast<std::size_t>(std::ceil(kAudited * static_cast<double>(order.size() + audited)));
  std::sort(order.begin(), order.end());
  std::vector<int> chosen;
  for (std::size_t i = 0; i + audited < wanted && i < order.size(); ++i) {
    chosen.push_back(order[i].second);
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

absl::StatusOr<Audit> AuditOf(const Definition& definition, const History& history) {
  Audit audit;
  for (const store::SampleRecord& sample : history.samples) {
    if (std::isnan(sample.audited)) continue;
    ++audit.samples;
    audit.bound += sample.audited;
  }
  if (audit.samples == 0) {
    return audit;
  }
  ASSIGN_OR_RETURN(const auto finished,
                   FinishedMass(definition, history,
                                inference::LogImportance(definition.priors, history.iterations)));
  for (std::size_t i = 0; i < finished.log_weights.size(); ++i) {
    if (!std::isnan(history.samples[i].audited)) {
      audit.measured += std::exp(finished.log_weights[i] - finished.log_mass);
    }
  }
  return audit;
}

double BestPossible(const inference::GaussianLikelihood& likelihood,
                    const Eigen::RowVectorXd& predictions) {
  return likelihood.LogLikelihoodBound(Eigen::MatrixXd(predictions))(0);
}

}  // namespace calib::planning
