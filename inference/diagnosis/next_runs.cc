#include "inference/diagnosis/next_runs.h"

#include <algorithm>
#include <cmath>

#include "inference/numerics/decompositions.h"
#include "inference/numerics/infinity.h"
#include "inference/numerics/log_weights.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// What one model believes of the candidates' outputs, were it right.
struct Belief {
  double weight = 0;
  // Of each draw: mean at the candidates (n x q), and covariance with the draw's own output over
  // the sd of the measurement there (n x q), whose square the measurement takes away.
  std::vector<Eigen::MatrixXd> mean, known;
};

Belief BeliefOf(const MeasuredSet& measured, const ModelEvidence& model,
                const Eigen::MatrixXd& candidate_mean, const Eigen::MatrixXd& candidate_factor,
                int draws) {
  const FeatureEmulator& emulator = measured.set->emulator();
  const SpecimenErrors errors = measured.set->ErrorsOfMean(measured.specimens);
  const Index all = model.draws.rows(), take = std::min<Index>(draws, all);
  std::vector<Index> rows;
  for (Index i = 0; i < take; ++i) rows.push_back((2 * i + 1) * all / (2 * take));
  const DesignPoints at = RowsOf(model.draws, rows);
  const EmulatorPrediction prediction = emulator.Predict(at);
  const Eigen::MatrixXd factor = emulator.Factor(at);
  Eigen::MatrixXd variance = DiagonalVariance(prediction, errors);
  // Staging and discrepancy count by their variance in each coordinate.
  if (errors.staging.cols() > 0)
    variance.rowwise() += errors.staging.cwiseAbs2().rowwise().sum().transpose();
  if (model.model.none_of_these) {
    const auto free = static_cast<double>(measured.z.size() - at.base.cols());
    for (Index i = 0; i < take; ++i)
      variance.row(i).array() += std::pow(model.tau[rows[static_cast<std::size_t>(i)]], 2) / free;
  }
  Belief result;
  for (Index i = 0; i < take; ++i) {
    const Eigen::MatrixXd covariance =
        (candidate_factor.array().rowwise() * factor.row(i).array()).matrix() * emulator.shrink();
    const Eigen::RowVectorXd gain =
        (measured.z.transpose() - prediction.mean.row(i)).array() / variance.row(i).array();
    result.mean.push_back(candidate_mean + covariance * gain.asDiagonal());
    result.known.push_back(covariance * variance.row(i).cwiseSqrt().cwiseInverse().asDiagonal());
  }
  return result;
}

// Normal law of the outputs of some candidates in one coordinate.
struct NormalBelief {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

NormalBelief Moments(const Belief& belief, const std::vector<Index>& rows, Index coordinate,
                     const Eigen::MatrixXd& prior) {
  const auto n = static_cast<Index>(rows.size());
  const auto draws = static_cast<double>(belief.mean.size());
  NormalBelief result{.mean = Eigen::VectorXd::Zero(n), .covariance = prior};
  std::vector<Eigen::VectorXd> means;
  for (std::size_t d = 0; d < belief.mean.size(); ++d) {
    means.push_back(belief.mean[d](rows, coordinate));
    const Eigen::VectorXd known = belief.known[d](rows, coordinate);
    result.mean += means.back() / draws;
    result.covariance -= known * known.transpose() / draws;
  }
  for (const Eigen::VectorXd& mean : means)
    result.covariance += (mean - result.mean) * (mean - result.mean).transpose() / draws;
  return result;
}

double LogDeterminant(const Eigen::MatrixXd& covariance) {
  return 2 * Eigen::LLT<Eigen::MatrixXd>(covariance).matrixLLT().diagonal().array().log().sum();
}

double PairBound(const std::vector<Belief>& beliefs, const Eigen::MatrixXd& distance) {
  double result = 0;
  for (Index i = 0; i < distance.rows(); ++i) {
    double sum = 0;
    for (Index j = 0; j < distance.cols(); ++j)
      sum += beliefs[static_cast<std::size_t>(j)].weight * std::exp(-distance(i, j));
    result -= beliefs[static_cast<std::size_t>(i)].weight * std::log(sum);
  }
  return result;
}

}  // namespace

std::vector<Index> LeadingModels(const std::vector<ModelEvidence>& evidence,
                                 const EffectProbabilities& probabilities, double least, int most) {
  std::vector<Index> result;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    if (evidence[i].draws.rows() > 0 && probabilities.model[static_cast<Index>(i)] >= least)
      result.push_back(static_cast<Index>(i));
  }
  std::stable_sort(result.begin(), result.end(), [&](Index a, Index b) {
    return probabilities.model[a] > probabilities.model[b];
  });
  if (static_cast<int>(result.size()) > most) result.resize(static_cast<std::size_t>(most));
  return result;
}

absl::StatusOr<ChosenRuns> NextRuns(const MeasuredSet& measured,
                                    const std::vector<ModelEvidence>& evidence,
                                    const EffectProbabilities& probabilities,
                                    const DesignPoints& candidates,
                                    const NextRunsOptions& options) {
  const FeatureEmulator& emulator = measured.set->emulator();
  if (!emulator.features().Fits(candidates) || candidates.rows() == 0 || options.runs < 1 ||
      options.draws < 1 || measured.z.size() != emulator.coordinates() ||
      probabilities.model.size() != static_cast<Index>(evidence.size()))
    return absl::InvalidArgumentError("candidates, measurement or models do not fit the emulator");
  const Index n = candidates.rows(), q = emulator.coordinates();
  const EmulatorPrediction prediction = emulator.Predict(candidates);
  const Eigen::MatrixXd factor = emulator.Factor(candidates);
  // Variance of a run on a packing of its own about the mean.
  const Eigen::MatrixXd run =
      (prediction.added_run_variance * emulator.variances().run.transpose()).rowwise() +
      emulator.specimen().transpose();

  std::vector<Belief> beliefs;
  double total = 0;
  for (const Index model :
       LeadingModels(evidence, probabilities, options.leading, options.most_models)) {
    beliefs.push_back(BeliefOf(measured, evidence[static_cast<std::size_t>(model)], prediction.mean,
                               factor, options.draws));
    beliefs.back().weight = probabilities.model[model];
    total += beliefs.back().weight;
  }
  if (beliefs.empty()) return absl::InvalidArgumentError("no model has posterior draws");
  for (Belief& belief : beliefs) belief.weight /= total;
  const auto models = static_cast<Index>(beliefs.size());

  ChosenRuns result;
  for (int step = 0; step < options.runs; ++step) {
    Index best = 0;
    double most = -kInfinity;
    for (Index candidate = 0; candidate < n; ++candidate) {
      std::vector<Index> rows = result.rows;
      rows.push_back(candidate);
      const Eigen::MatrixXd chosen = factor(rows, Eigen::all);
      Eigen::MatrixXd distance = Eigen::MatrixXd::Zero(models, models);
      for (Index c = 0; c < q; ++c) {
        Eigen::MatrixXd prior = chosen * emulator.shrink().col(c).asDiagonal() * chosen.transpose();
        for (Index i = 0; i < prior.rows(); ++i)
          prior(i, i) += run(rows[static_cast<std::size_t>(i)], c);
        std::vector<NormalBelief> normal;
        std::vector<double> log_determinant;
        for (const Belief& belief : beliefs) {
          normal.push_back(Moments(belief, rows, c, prior));
          log_determinant.push_back(LogDeterminant(normal.back().covariance));
        }
        for (Index a = 0; a < models; ++a) {
          for (Index b = 0; b < a; ++b) {
            const NormalBelief& x = normal[static_cast<std::size_t>(a)];
            const NormalBelief& y = normal[static_cast<std::size_t>(b)];
            const Eigen::LLT<Eigen::MatrixXd> middle(0.5 * (x.covariance + y.covariance));
            // [Kailath, IEEE Trans. Commun. 15 (1967) 52]
            const double d = LowerSolved(middle, x.mean - y.mean).squaredNorm() / 8 +
                             middle.matrixLLT().diagonal().array().log().sum() -
                             0.25 * (log_determinant[static_cast<std::size_t>(a)] +
                                     log_determinant[static_cast<std::size_t>(b)]);
            distance(a, b) += d;
            distance(b, a) += d;
          }
        }
      }
      const double information = PairBound(beliefs, distance);
      if (information > most) {
        most = information;
        best = candidate;
      }
    }
    result.rows.push_back(best);
    result.information.push_back(most);
  }
  return result;
}

}  // namespace calib::inference
