#include "inference/diagnosis/next_measurement.h"

#include <algorithm>
#include <cmath>

#include "inference/diagnosis/next_runs.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/log_weights.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Normal law of the measurement at one draw of one model.
struct ForecastLaw {
  Eigen::VectorXd mean;
  Eigen::LLT<Eigen::MatrixXd> factor;
  double log_determinant;  // half of it

  double LogDensity(const Eigen::VectorXd& z) const {
    return -0.5 * LowerSolved(factor, z - mean).squaredNorm() - log_determinant;
  }
};

// Laws at evenly spread draws of a model.
std::vector<ForecastLaw> LawsOf(const ProposedMeasurement& proposed, const ModelEvidence& model,
                                int draws) {
  const FeatureEmulator& emulator = proposed.set->emulator();
  const SpecimenErrors& errors = proposed.set->errors();
  const Index q = emulator.coordinates(), d = model.draws.base.cols();
  const Index all = model.draws.rows(), take = std::min<Index>(draws, all);
  std::vector<Index> rows;
  for (Index i = 0; i < take; ++i) rows.push_back((2 * i + 1) * all / (2 * take));
  const DesignPoints at = ColumnsOf(RowsOf(model.draws, rows), proposed.columns);
  const EmulatorPrediction prediction = emulator.Predict(at);
  std::vector<Eigen::MatrixXd> sensitivities;
  for (Index j = 0; j < d && model.model.none_of_these; ++j)
    sensitivities.push_back(emulator.BaseDerivative(at.base, j));
  std::vector<ForecastLaw> result;
  for (Index i = 0; i < take; ++i) {
    // What two measurements of the same tests share, and what each has of its own.
    Eigen::MatrixXd shared = errors.staging * errors.staging.transpose();
    shared.diagonal() +=
        prediction.variance.row(i).transpose() + prediction.added_run_variance[i] * errors.run;
    if (errors.missed.size() > 0) shared.diagonal() += errors.missed;
    if (model.model.none_of_these) {
      Eigen::MatrixXd directions(q, d);
      for (Index j = 0; j < d; ++j)
        directions.col(j) = sensitivities[static_cast<std::size_t>(j)].row(i);
      const Eigen::MatrixXd along =
          OrthonormalColumns(Eigen::HouseholderQR<Eigen::MatrixXd>(directions));
      const double tau = model.tau[rows[static_cast<std::size_t>(i)]];
      shared += tau * tau / static_cast<double>(q - d) *
                (Eigen::MatrixXd::Identity(q, q) - along * along.transpose());
    }
    const Eigen::VectorXd own = errors.Own();
    Eigen::MatrixXd covariance = shared;
    covariance.diagonal() += own;
    ForecastLaw law{.mean = prediction.mean.row(i), .factor = {}, .log_determinant = 0};
    if (proposed.measured.size() > 0) {
      Eigen::MatrixXd of_mean = shared;
      of_mean.diagonal() += own / proposed.specimens;
      const Eigen::LLT<Eigen::MatrixXd> before(of_mean);
      const Eigen::MatrixXd half = LowerSolved(before, shared);
      law.mean += half.transpose() * LowerSolved(before, proposed.measured - law.mean);
      covariance -= half.transpose() * half;
    }
    law.factor.compute(covariance);
    law.log_determinant = law.factor.matrixLLT().diagonal().array().log().sum();
    result.push_back(std::move(law));
  }
  return result;
}

bool HasAll(const PartOfColumns& part, const EffectModel& model) {
  return !part || std::all_of(model.effects.begin(), model.effects.end(), [&part](int k) {
    return std::count(part->strength.begin(), part->strength.end(), k) > 0;
  });
}

double Entropy(const Eigen::VectorXd& p) {
  double result = 0;
  for (const double x : p) result -= x > 0 ? x * std::log(x) : 0;
  return result;
}

}  // namespace

absl::StatusOr<Forecast> ExpectedInformation(const ProposedMeasurement& proposed,
                                             const std::vector<ModelEvidence>& evidence,
                                             const EffectProbabilities& probabilities,
                                             const ForecastOptions& options) {
  const Index q = proposed.set->emulator().coordinates();
  if (options.measurements < 10 || options.draws < 2 ||
      probabilities.model.size() != static_cast<Index>(evidence.size()) ||
      (proposed.measured.size() > 0 && proposed.measured.size() != q) || proposed.specimens < 1)
    return absl::InvalidArgumentError("measurement, models or options do not fit");
  std::vector<Index> leading =
      LeadingModels(evidence, probabilities, options.leading, options.most_models);
  std::erase_if(leading, [&](Index m) {
    return !HasAll(proposed.columns, evidence[static_cast<std::size_t>(m)].model);
  });
  if (leading.empty()) return absl::InvalidArgumentError("no model has posterior draws");
  const auto models = static_cast<Index>(leading.size());
  Eigen::VectorXd weight(models);
  std::vector<std::vector<ForecastLaw>> laws;
  for (Index m = 0; m < models; ++m) {
    const ModelEvidence& model =
        evidence[static_cast<std::size_t>(leading[static_cast<std::size_t>(m)])];
    if (!proposed.set->emulator().features().Fits(ColumnsOf(model.draws, proposed.columns)) ||
        q <= model.draws.base.cols())
      return absl::InvalidArgumentError("the set's emulator has other parameters than the models");
    weight[m] = probabilities.model[leading[static_cast<std::size_t>(m)]];
    laws.push_back(LawsOf(proposed, model, options.draws));
  }
  weight /= weight.sum();
  const double before = Entropy(weight);

  Forecast result;
  double squares = 0;
  int named_right = 0, decided = 0, named_wrong = 0;
  const auto n = static_cast<double>(options.measurements);
  for (int s = 0; s < options.measurements; ++s) {
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kDiagnosisForecast,
                         .iteration = 0,
                         .sample = static_cast<std::uint64_t>(s)});
    // Models in proportion to their probabilities, evenly: the s-th of n equal parts.
    double u = (s + stream.Uniform()) / n;
    Index truth = 0;
    while (truth + 1 < models && u >= weight[truth]) u -= weight[truth++];
    const std::vector<ForecastLaw>& own = laws[static_cast<std::size_t>(truth)];
    const auto draw =
        std::min(own.size() - 1,
                 static_cast<std::size_t>(stream.Uniform() * static_cast<double>(own.size())));
    Eigen::VectorXd normal(q);
    for (double& z : normal) z = stream.Normal();
    const Eigen::VectorXd z = own[draw].mean + own[draw].factor.matrixL() * normal;
    Eigen::VectorXd logs(models);
    for (Index m = 0; m < models; ++m) {
      const std::vector<ForecastLaw>& law = laws[static_cast<std::size_t>(m)];
      // The draw that z was made at would vouch for its own model: it is left out.
      Eigen::VectorXd density(static_cast<Index>(law.size()) -
                              (m == truth && law.size() > 1 ? 1 : 0));
      Index place = 0;
      for (std::size_t i = 0; i < law.size(); ++i) {
        if (m == truth && i == draw && law.size() > 1) continue;
        density[place++] = law[i].LogDensity(z);
      }
      logs[m] =
          std::log(weight[m]) + LogSumExp(density) - std::log(static_cast<double>(density.size()));
    }
    const Eigen::VectorXd after = NormalizedLogWeights(logs).array().exp();
    const double gain = before - Entropy(after);
    result.information += gain / n;
    squares += gain * gain / n;
    Eigen::VectorXd inclusion = Eigen::VectorXd::Zero(probabilities.inclusion.size());
    for (Index m = 0; m < models; ++m) {
      for (const int e :
           evidence[static_cast<std::size_t>(leading[static_cast<std::size_t>(m)])].model.effects)
        inclusion[e] += after[m];
    }
    const std::vector<int>& acts =
        evidence[static_cast<std::size_t>(leading[static_cast<std::size_t>(truth)])].model.effects;
    std::size_t right = 0, wrong = 0;
    for (Index e = 0; e < inclusion.size(); ++e) {
      if (inclusion[e] < options.alone) continue;
      ++(std::count(acts.begin(), acts.end(), static_cast<int>(e)) > 0 ? right : wrong);
    }
    const bool all = right == acts.size() && wrong == 0;
    named_right += !acts.empty() && all ? 1 : 0;
    decided += all && (!acts.empty() || after[truth] >= options.alone) ? 1 : 0;
    named_wrong += wrong > 0 ? 1 : 0;
  }
  result.named_right = named_right / n;
  result.decided = decided / n;
  result.named_wrong = named_wrong / n;
  result.error =
      std::sqrt(std::max(squares - result.information * result.information, 0.0) / (n - 1));
  return result;
}

}  // namespace calib::inference
