#include "inference/diagnosis/model_evidence.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/evidence/pareto_tail.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

absl::Status CheckMeasured(const std::vector<MeasuredSet>& measured, const ModelSpace& space) {
  RETURN_IF_ERROR(space.Validate());
  if (measured.empty()) return absl::InvalidArgumentError("nothing is measured");
  for (const MeasuredSet& m : measured) {
    const EffectFeatures& features = m.set->emulator().features();
    if (m.z.size() != m.set->emulator().coordinates() || !m.z.allFinite()) {
      return absl::InvalidArgumentError(absl::StrCat("a measurement has ", m.z.size(),
                                                     " coordinates, its set ",
                                                     m.set->emulator().coordinates()));
    }
    const PartOfColumns& part = m.columns;
    if (features.effects().size() != (part ? part->strength.size() : space.effects.size()) ||
        features.parameters() != space.base_low.size() ||
        features.shape_count() !=
            (part ? static_cast<Index>(part->shape.size()) : space.shape_low.size()))
      return absl::InvalidArgumentError("a set's emulator has other parameters than the space");
    for (const EffectModel& model : space.models) {
      for (const int k : model.effects) {
        if (part && std::count(part->strength.begin(), part->strength.end(), k) == 0) {
          return absl::InvalidArgumentError(
              absl::StrCat("a model has effect ", k, ", which a set's emulator has not"));
        }
      }
    }
    if (m.specimens < 1) return absl::InvalidArgumentError("a measurement has no specimen");
    if (m.z.size() <= features.parameters())
      return absl::InvalidArgumentError("fewer coordinates than base parameters");
  }
  return absl::OkStatus();
}

Eigen::VectorXd FiniteOrNone(Eigen::VectorXd log_density) {
  for (double& value : log_density) value = std::isfinite(value) ? value : -kInfinity;
  return log_density;
}

Eigen::VectorXd LogDensityOf(const std::vector<MeasuredSet>& measured, const EffectModel& model,
                             const DesignPoints& points, const Eigen::VectorXd& tau) {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(points.rows());
  for (const MeasuredSet& m : measured) {
    const DesignPoints own = ColumnsOf(points, m.columns);
    const Eigen::VectorXd density =
        model.none_of_these ? m.set->LogDensityWithDiscrepancy(m.z, own, tau, m.specimens)
                            : m.set->LogDensity(m.z, own, m.specimens);
    result += m.taken_out ? Eigen::VectorXd(-density) : density;
  }
  return FiniteOrNone(std::move(result));
}

// The same were each emulator its realisation by `coefficients`, one for each set.
Eigen::VectorXd RealisedLogDensity(const std::vector<MeasuredSet>& measured,
                                   const std::vector<Eigen::MatrixXd>& coefficients,
                                   const ModelEvidence& model) {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(model.draws.rows());
  for (std::size_t s = 0; s < measured.size(); ++s) {
    const DesignPoints points = ColumnsOf(model.draws, measured[s].columns);
    const double sign = measured[s].taken_out ? -1 : 1;
    const FeatureEmulator& emulator = measured[s].set->emulator();
    const SpecimenErrors errors = measured[s].set->ErrorsOfMean(measured[s].specimens);
    const Eigen::MatrixXd terms = emulator.features().VarianceTerms(points);
    const RunVariance& kappa = emulator.run_variance();
    const EmulatorPrediction prediction{
        .mean = emulator.MeanOf(coefficients[s], points),
        .variance = Eigen::MatrixXd::Zero(points.rows(), emulator.coordinates()),
        .added_run_variance = kappa.single * terms.col(0) + kappa.pair * terms.col(1)};
    if (model.model.none_of_these) {
      OrthogonalDiscrepancy discrepancy{.sensitivities = {}, .tau = model.tau};
      for (Index j = 0; j < points.base.cols(); ++j)
        discrepancy.sensitivities.push_back(emulator.BaseDerivative(points.base, j));
      result += sign * SpecimenLogDensity(measured[s].z, prediction, errors, discrepancy);
    } else {
      result += sign * SpecimenLogDensity(measured[s].z, prediction, errors);
    }
  }
  return FiniteOrNone(std::move(result));
}

// Points of one choice of signs, with the logarithms of their weights under the space's priors.
struct SignedSample {
  ModelCube cube;
  Eigen::MatrixXd points;       // n x dimensions
  Eigen::VectorXd log_weights;  // n: ln of likelihood over proposal
  double best;                  // largest ln L
};

std::vector<SignedSample> SampleSigns(const std::vector<MeasuredSet>& measured,
                                      const ModelSpace& space, const EffectModel& model,
                                      std::uint64_t number, const EvidenceOptions& options) {
  std::vector<SignedSample> result;
  for (std::vector<int>& sign : SignsOf(space, model)) {
    ModelCube cube(space, model, std::move(sign));
    CubeSamplingOptions sampling = options.sampling;
    sampling.number = number * 8 + result.size();
    const CubeLikelihood likelihood = [&](const Eigen::MatrixXd& u) {
      const DesignPoints points = cube.Points(u);
      const Eigen::VectorXd tau = model.none_of_these ? cube.Tau(u) : Eigen::VectorXd();
      return Eigen::VectorXd(LogDensityOf(measured, model, points, tau) + cube.LogPrior(points));
    };
    CubeSample sample = SampleCube(likelihood, cube.dimensions(), sampling);
    // Normalised weights know the evidence no more.
    if (std::isfinite(sample.evidence.log_evidence)) {
      sample.log_weights.array() +=
          sample.evidence.log_evidence + std::log(static_cast<double>(sample.log_weights.size()));
    }
    result.push_back({.cube = std::move(cube),
                      .points = std::move(sample.points),
                      .log_weights = std::move(sample.log_weights),
                      .best = sample.best});
  }
  return result;
}

// ln of a narrower prior's density over that of the space, log-uniform both, at each point.
Eigen::VectorXd LogPriorRatio(const ModelSpace& space, const std::vector<StrengthPrior>& prior,
                              const EffectModel& model, const DesignPoints& points) {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(points.rows());
  for (const int effect : model.effects) {
    const StrengthPrior& own = prior[static_cast<std::size_t>(effect)];
    const StrengthPrior& wide = space.strength[static_cast<std::size_t>(effect)];
    for (Index i = 0; i < points.rows(); ++i) {
      const double s = points.strength(i, effect);
      const double low = s > 0 ? own.low : own.negative_low;
      const double high = s > 0 ? own.high : own.negative_high;
      const double range =
          s > 0 ? std::log(wide.high / wide.low) : std::log(wide.negative_high / wide.negative_low);
      const bool all = low == (s > 0 ? wide.low : wide.negative_low) &&
                       high == (s > 0 ? wide.high : wide.negative_high);
      if (all) continue;
      result[i] += std::abs(s) < low || std::abs(s) > high ? -kInfinity
                                                           : std::log(range / std::log(high / low));
    }
  }
  return result;
}

// Posterior draws: points of all signs, evenly through their weights, whose sum is exp(log_sum).
void SetDraws(const std::vector<SignedSample>& signs,
              const std::vector<Eigen::VectorXd>& log_weights, double log_sum, int draws,
              double start, ModelEvidence& result) {
  double cumulated = 0, next = start;
  std::vector<DesignPoints> parts;
  std::vector<double> tau;
  Index total = 0;
  for (std::size_t s = 0; s < signs.size(); ++s) {
    Eigen::MatrixXd chosen(draws, signs[s].cube.dimensions());
    Index count = 0;
    for (Index i = 0; i < log_weights[s].size(); ++i) {
      cumulated += std::exp(log_weights[s][i] - log_sum) * draws;
      for (; next < cumulated && count < draws; next += 1)
        chosen.row(count++) = signs[s].points.row(i);
    }
    if (count == 0) continue;
    total += count;
    parts.push_back(signs[s].cube.Points(chosen.topRows(count)));
    if (!result.model.none_of_these) continue;
    const Eigen::VectorXd t = signs[s].cube.Tau(chosen.topRows(count));
    tau.insert(tau.end(), t.begin(), t.end());
  }
  if (total == 0) return;
  result.draws = {.base = Eigen::MatrixXd(total, parts[0].base.cols()),
                  .strength = Eigen::MatrixXd(total, parts[0].strength.cols()),
                  .shape = Eigen::MatrixXd(total, parts[0].shape.cols())};
  Index row = 0;
  for (const DesignPoints& part : parts) {
    result.draws.base.middleRows(row, part.rows()) = part.base;
    result.draws.strength.middleRows(row, part.rows()) = part.strength;
    result.draws.shape.middleRows(row, part.rows()) = part.shape;
    row += part.rows();
  }
  result.tau = Eigen::Map<const Eigen::VectorXd>(tau.data(), static_cast<Index>(tau.size()));
}

// Evidence and draws under one prior from points sampled under the space's.
ModelEvidence EvidenceUnder(const std::vector<SignedSample>& signs, const ModelSpace& space,
                            const EffectModel& model, const std::vector<StrengthPrior>& prior,
                            int draws, double start) {
  ModelEvidence result{.model = model, .tail = -kInfinity, .best = -kInfinity};
  const double number = static_cast<double>(signs.size());
  std::vector<Eigen::VectorXd> log_weights;
  std::vector<EvidenceEstimate> each;
  Eigen::VectorXd logs(static_cast<Index>(signs.size())), sums = logs;
  for (std::size_t s = 0; s < signs.size(); ++s) {
    const SignedSample& sample = signs[s];
    log_weights.emplace_back(sample.log_weights +
                             LogPriorRatio(space, prior, model, sample.cube.Points(sample.points)));
    each.push_back(ImportanceEvidence(log_weights.back()));
    result.tail = std::max(result.tail, ParetoTailIndex(log_weights.back()));
    result.best = std::max(result.best, sample.best);
    // Signs are equally probable before.
    logs[static_cast<Index>(s)] = each.back().log_evidence - std::log(number);
    sums[static_cast<Index>(s)] = LogSumExp(log_weights.back());
  }
  const double sum = LogSumExp(logs);
  result.evidence = {.log_evidence = sum, .standard_error = kInfinity};
  if (!std::isfinite(sum)) return result;
  double variance = 0;
  for (std::size_t s = 0; s < signs.size(); ++s) {
    const double share = std::exp(logs[static_cast<Index>(s)] - sum);
    if (share > 0) variance += std::pow(share * each[s].standard_error, 2);
  }
  result.evidence.standard_error = std::sqrt(variance);
  SetDraws(signs, log_weights, LogSumExp(sums), draws, start, result);
  return result;
}

bool Within(const StrengthPrior& own, const StrengthPrior& wide, bool two_sided) {
  return own.low >= wide.low && own.low < own.high && own.high <= wide.high &&
         (!two_sided ||
          (own.negative_low >= wide.negative_low && own.negative_low < own.negative_high &&
           own.negative_high <= wide.negative_high));
}

// Sets ModelEvidence::realised of models of one prior.
void Realise(const std::vector<MeasuredSet>& measured, const EvidenceOptions& options,
             std::vector<ModelEvidence>& result) {
  std::vector<Eigen::VectorXd> marginal;  // log densities of the draws, emulator's variance in them
  for (ModelEvidence& model : result) {
    model.realised = Eigen::VectorXd::Constant(options.realisations, -kInfinity);
    marginal.push_back(model.draws.rows() == 0
                           ? Eigen::VectorXd()
                           : LogDensityOf(measured, model.model, model.draws, model.tau));
  }
  for (int r = 0; r < options.realisations; ++r) {
    std::vector<Eigen::MatrixXd> coefficients;
    for (const MeasuredSet& own : measured) {  // one realisation of each emulator
      const auto first = std::find_if(measured.begin(), measured.end(),
                                      [&own](const auto& other) { return other.set == own.set; });
      const auto s = static_cast<std::uint64_t>(first - measured.begin());
      coefficients.push_back(own.set->emulator().Realisation(options.sampling.seed + s,
                                                             static_cast<std::uint64_t>(r)));
    }
    for (std::size_t i = 0; i < result.size(); ++i) {
      ModelEvidence& model = result[i];
      if (model.draws.rows() == 0) continue;
      const Eigen::VectorXd ratio = RealisedLogDensity(measured, coefficients, model) - marginal[i];
      model.realised[r] = model.evidence.log_evidence + LogSumExp(ratio) -
                          std::log(static_cast<double>(model.draws.rows()));
    }
  }
}

}  // namespace

absl::StatusOr<std::vector<std::vector<ModelEvidence>>> ModelEvidencesUnder(
    const std::vector<MeasuredSet>& measured, const ModelSpace& space,
    const std::vector<std::vector<StrengthPrior>>& priors, const EvidenceOptions& options) {
  RETURN_IF_ERROR(CheckMeasured(measured, space));
  if (options.draws < 2 || options.realisations < 2 || options.first < 0 || priors.empty()) {
    return absl::InvalidArgumentError(
        "a prior, two draws and realisations and a place >= 0 are asked for");
  }
  for (const std::vector<StrengthPrior>& prior : priors) {
    if (prior.size() != space.effects.size())
      return absl::InvalidArgumentError("as many strength priors as effects are asked for");
    for (std::size_t k = 0; k < prior.size(); ++k) {
      if (!Within(prior[k], space.strength[k], space.effects[k].two_sided)) {
        return absl::InvalidArgumentError(
            absl::StrCat("a prior on the strength of effect ", k, " is not within the space's"));
      }
    }
  }
  std::vector<std::vector<ModelEvidence>> result(priors.size());
  for (std::size_t i = 0; i < space.models.size(); ++i) {
    const EffectModel& model = space.models[i];
    const std::uint64_t place = i + static_cast<std::uint64_t>(options.first);
    const std::vector<SignedSample> signs = SampleSigns(measured, space, model, place, options);
    PhiloxStream stream({.seed = options.sampling.seed,
                         .purpose = StreamPurpose::kDiagnosisEvidence,
                         .iteration = ~std::uint64_t{0},
                         .sample = place});
    const double start = stream.Uniform();
    for (std::size_t w = 0; w < priors.size(); ++w)
      result[w].push_back(EvidenceUnder(signs, space, model, priors[w], options.draws, start));
  }
  for (std::vector<ModelEvidence>& models : result) Realise(measured, options, models);
  return result;
}

absl::StatusOr<std::vector<ModelEvidence>> ModelEvidences(const std::vector<MeasuredSet>& measured,
                                                          const ModelSpace& space,
                                                          const EvidenceOptions& options) {
  ASSIGN_OR_RETURN(auto under, ModelEvidencesUnder(measured, space, {space.strength}, options));
  return std::move(under[0]);
}

}  // namespace calib::inference
