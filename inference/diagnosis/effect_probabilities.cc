#include "inference/diagnosis/effect_probabilities.h"

#include <algorithm>
#include <cmath>

#include "inference/evidence/model_probabilities.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Part of a range next to its end that counts as beyond it.
constexpr double kEndOfRange = 0.01;

Eigen::VectorXd InclusionOf(const Eigen::VectorXd& model, const std::vector<EffectModel>& models,
                            Index effects) {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(effects);
  for (std::size_t i = 0; i < models.size(); ++i) {
    for (const int k : models[i].effects) result[k] += model[static_cast<Index>(i)];
  }
  return result;
}

// Largest part of the draws beyond the design in the strength of an effect or one base parameter.
double PartBeyond(const DesignPoints& draws, int effect, const DesignRange& range) {
  const auto n = static_cast<double>(draws.rows());
  const auto s = draws.strength.col(effect).array();
  // A hundredth of what the design spans in the logarithm of strength is about one per cent of the
  // strength itself.
  const double part = static_cast<double>((s > range.strength_high[effect] * (1 - kEndOfRange) ||
                                           s < -range.negative_high[effect] * (1 - kEndOfRange))
                                              .count()) /
                      n;
  double result = part;
  for (Index j = 0; j < draws.base.cols(); ++j) {
    const double end = kEndOfRange * (range.base_high[j] - range.base_low[j]);
    const auto x = draws.base.col(j).array();
    result = std::max(
        result,
        static_cast<double>((x < range.base_low[j] + end || x > range.base_high[j] - end).count()) /
            n);
  }
  return result;
}

}  // namespace

absl::StatusOr<EffectProbabilities> ProbabilitiesOf(const std::vector<ModelEvidence>& evidence,
                                                    const ModelSpace& space) {
  if (evidence.size() != space.models.size())
    return absl::InvalidArgumentError("evidences and models do not fit");
  const Eigen::VectorXd log_prior = space.LogPrior();
  const auto k = static_cast<Index>(space.effects.size());
  std::vector<EvidenceEstimate> posterior;
  std::vector<Index> finite;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (!(evidence[i].model == space.models[i]))
      return absl::InvalidArgumentError("evidences are not in the order of the models");
    EvidenceEstimate estimate = evidence[i].evidence;
    estimate.log_evidence += log_prior[static_cast<Index>(i)];
    if (!std::isfinite(estimate.log_evidence) || !std::isfinite(estimate.standard_error)) continue;
    posterior.push_back(estimate);
    finite.push_back(static_cast<Index>(i));
  }
  if (posterior.empty()) return absl::InvalidArgumentError("no model has a finite evidence");
  EffectProbabilities result;
  result.model = Eigen::VectorXd::Zero(log_prior.size());
  const std::vector<ModelProbability> probability = ModelProbabilities(posterior);
  for (std::size_t i = 0; i < finite.size(); ++i)
    result.model[finite[i]] = probability[i].probability;
  result.inclusion = InclusionOf(result.model, space.models, k);
  result.share = Eigen::VectorXd::Zero(k);
  for (std::size_t i = 0; i < space.models.size(); ++i) {
    const EffectModel& model = space.models[i];
    const double p = result.model[static_cast<Index>(i)];
    if (model.none_of_these) result.none_of_these += p;
    if (!model.none_of_these && model.effects.empty()) result.adequate += p;
    for (const int e : model.effects)
      result.share[e] += p / static_cast<double>(model.effects.size());
  }

  const Index realisations = evidence[0].realised.size();
  Eigen::MatrixXd inclusion(realisations, k);
  for (Index r = 0; r < realisations; ++r) {
    Eigen::VectorXd logs = Eigen::VectorXd::Constant(log_prior.size(), -kInfinity);
    for (const Index i : finite)
      logs[i] = evidence[static_cast<std::size_t>(i)].realised[r] + log_prior[i];
    inclusion.row(r) =
        InclusionOf(NormalizedLogWeights(logs).array().exp(), space.models, k).transpose();
  }
  result.inclusion_sd = Eigen::VectorXd::Zero(k);
  if (realisations > 1) {
    result.inclusion_sd =
        ((inclusion.rowwise() - inclusion.colwise().mean()).colwise().squaredNorm() /
         static_cast<double>(realisations - 1))
            .cwiseSqrt();
  }
  return result;
}

DesignRange RangeOf(const DesignPoints& runs) {
  return {.base_low = runs.base.colwise().minCoeff(),
          .base_high = runs.base.colwise().maxCoeff(),
          .strength_high = runs.strength.colwise().maxCoeff().cwiseMax(0),
          .negative_high = (-runs.strength).colwise().maxCoeff().cwiseMax(0)};
}

Eigen::VectorXd BeyondDesign(const std::vector<ModelEvidence>& evidence,
                             const EffectProbabilities& probabilities, const DesignRange& range) {
  const Index k = probabilities.inclusion.size();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(k), weight = sum;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (evidence[i].draws.rows() == 0) continue;
    const double p = probabilities.model[static_cast<Index>(i)];
    for (const int e : evidence[i].model.effects) {
      sum[e] += p * PartBeyond(evidence[i].draws, e, range);
      weight[e] += p;
    }
  }
  for (Index e = 0; e < k; ++e) sum[e] = weight[e] > 0 ? sum[e] / weight[e] : 0;
  return sum;
}

double VerificationChance(const DiagnosisSet& set, const DesignPoints& points,
                          const std::vector<int>& packing, const Eigen::MatrixXd& histories) {
  const FeatureEmulator& emulator = set.emulator();
  const Index n = points.rows(), q = emulator.coordinates();
  const EmulatorPrediction prediction = emulator.Predict(points);
  const Eigen::MatrixXd factor = emulator.Factor(points);
  const Eigen::MatrixXd error = set.coordinates()->Of(histories) - prediction.mean;
  Eigen::MatrixXd same(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j)
      same(i, j) = packing[static_cast<std::size_t>(i)] == packing[static_cast<std::size_t>(j)];
  }
  const double optimism = set.coordinates()->optimism();
  double chi2 = 0;
  for (Index c = 0; c < q; ++c) {
    const double run = emulator.variances().run[c];
    Eigen::MatrixXd v = factor * emulator.shrink().col(c).asDiagonal() * factor.transpose() +
                        (optimism * emulator.specimen()[c] - run) * same;
    v.diagonal().array() += run * (1 + prediction.added_run_variance.array());
    const double mean = error.col(c).mean();
    chi2 += mean * mean / v.mean();
  }
  const auto degrees = static_cast<double>(q);
  return FisherLaw{.numerator = degrees, .denominator = emulator.freedom()}.Tail(chi2 / degrees);
}

std::vector<std::vector<int>> Families(const Eigen::MatrixXd& angles,
                                       const std::vector<std::pair<int, int>>& kin,
                                       double degrees) {
  const auto k = static_cast<int>(angles.rows());
  Eigen::MatrixXd distance = angles.cwiseMax(angles.transpose());
  for (const auto& [a, b] : kin) distance(a, b) = distance(b, a) = 0;
  std::vector<std::vector<int>> groups(static_cast<std::size_t>(k));
  for (int e = 0; e < k; ++e) groups[static_cast<std::size_t>(e)] = {e};
  const auto apart = [&](const std::vector<int>& a, const std::vector<int>& b) {
    double largest = 0;
    for (const int x : a) {
      for (const int y : b) largest = std::max(largest, distance(x, y));
    }
    return largest;
  };
  while (groups.size() > 1) {
    std::size_t first = 0, second = 1;
    double closest = kInfinity;
    for (std::size_t a = 0; a < groups.size(); ++a) {
      for (std::size_t b = a + 1; b < groups.size(); ++b) {
        const double d = apart(groups[a], groups[b]);
        if (d < closest) {
          closest = d;
          first = a;
          second = b;
        }
      }
    }
    if (closest > degrees) break;
    groups[first].insert(groups[first].end(), groups[second].begin(), groups[second].end());
    std::sort(groups[first].begin(), groups[first].end());
    groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(second));
  }
  std::sort(groups.begin(), groups.end());
  return groups;
}

absl::StatusOr<DiagnosisAnswer> AnswerOf(const AnswerBasis& basis,
                                         const std::vector<EffectModel>& models,
                                         const AnswerLevels& levels) {
  if (basis.widths.empty() || basis.beyond.size() != basis.widths.size())
    return absl::InvalidArgumentError("no prior on strengths, or not its part beyond the design");
  const EffectProbabilities& reference = basis.widths[0];
  const Index k = reference.inclusion.size();
  if (basis.verification.size() != k || reference.model.size() != static_cast<Index>(models.size()))
    return absl::InvalidArgumentError("verification or models do not fit the effects");
  DiagnosisAnswer result;
  result.unexplained = reference.none_of_these >= levels.unexplained;

  for (const std::vector<int>& family : basis.families) {
    double probability = 0;
    for (std::size_t i = 0; i < models.size(); ++i) {
      const bool acts = std::any_of(family.begin(), family.end(), [&](int e) {
        return std::count(models[i].effects.begin(), models[i].effects.end(), e) > 0;
      });
      if (acts) probability += reference.model[static_cast<Index>(i)];
    }
    if (probability >= levels.family)
      result.families.push_back({.effects = family, .probability = probability});
  }

  result.sure = true;
  for (Index e = 0; e < k; ++e) {
    double least = 1, beyond = 0;
    for (std::size_t w = 0; w < basis.widths.size(); ++w) {
      if (basis.widths[w].inclusion.size() != k || basis.beyond[w].size() != k)
        return absl::InvalidArgumentError("priors on strengths are of different effects");
      least = std::min(least, basis.widths[w].inclusion[e]);
      beyond = std::max(beyond, basis.beyond[w][e]);
    }
    if (reference.inclusion[e] < levels.alone) continue;
    const auto effect = static_cast<int>(e);
    if (least < levels.alone) {
      result.not_named.emplace_back(effect, NotNamed::kOtherPrior);
    } else if (beyond > levels.beyond) {
      result.not_named.emplace_back(effect, NotNamed::kBeyondDesign);
    } else if (basis.verification[e] < levels.verification) {
      result.not_named.emplace_back(effect, NotNamed::kVerification);
    } else {
      result.alone.push_back(effect);
      result.sure = result.sure && least >= levels.sure;
    }
  }
  result.sure = result.sure && !result.alone.empty();

  std::vector<CredibleEntry> entries = {
      {.effect = CredibleEntry::kAdequate, .share = reference.adequate},
      {.effect = CredibleEntry::kNoneOfThese, .share = reference.none_of_these}};
  for (Index e = 0; e < k; ++e)
    entries.push_back({.effect = static_cast<int>(e), .share = reference.share[e]});
  std::stable_sort(
      entries.begin(), entries.end(),
      [](const CredibleEntry& a, const CredibleEntry& b) { return a.share > b.share; });
  double sum = 0;
  for (const CredibleEntry& entry : entries) {
    result.set.push_back(entry);
    sum += entry.share;
    if (sum >= levels.set) break;
  }
  return result;
}

}  // namespace calib::inference
