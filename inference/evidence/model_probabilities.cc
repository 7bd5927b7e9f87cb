#include "inference/evidence/model_probabilities.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "inference/numerics/log_weights.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

constexpr int kProbabilityDraws = 10'000;  // chosen: a probability is then known to 0.005

// Row i: the probabilities with the i-th draw of the errors, M columns.
Eigen::MatrixXd DrawProbabilities(std::span<const EvidenceEstimate> evidence) {
  Eigen::MatrixXd drawn(kProbabilityDraws, static_cast<Eigen::Index>(evidence.size()));
  for (Eigen::Index i = 0; i < kProbabilityDraws; ++i) {
    PhiloxStream stream({.seed = 0,
                         .purpose = StreamPurpose::kEvidenceErrors,
                         .iteration = 0,
                         .sample = static_cast<std::uint64_t>(i)});
    Eigen::VectorXd log_evidence(drawn.cols());
    for (std::size_t k = 0; k < evidence.size(); ++k) {
      log_evidence[static_cast<Eigen::Index>(k)] =
          evidence[k].log_evidence + evidence[k].standard_error * stream.Normal();
    }
    drawn.row(i) = NormalizedLogWeights(log_evidence).array().exp();
  }
  return drawn;
}

}  // namespace

std::vector<ModelProbability> ModelProbabilities(std::span<const EvidenceEstimate> evidence) {
  if (evidence.empty()) return {};
  const auto best = std::max_element(evidence.begin(), evidence.end(), [](auto& a, auto& b) {
    return a.log_evidence < b.log_evidence;
  });
  const Eigen::MatrixXd drawn = DrawProbabilities(evidence);
  std::vector<ModelProbability> models;
  for (std::size_t k = 0; k < evidence.size(); ++k) {
    Eigen::VectorXd column = drawn.col(static_cast<Eigen::Index>(k));
    ModelProbability& model = models.emplace_back();
    model.probability = column.mean();
    std::sort(column.begin(), column.end());
    model.q05 = column[kProbabilityDraws / 20];
    model.q95 = column[kProbabilityDraws - 1 - kProbabilityDraws / 20];
    if (&evidence[k] == &*best) continue;
    model.log_bayes_factor = evidence[k].log_evidence - best->log_evidence;
    model.log_bayes_factor_se = std::hypot(evidence[k].standard_error, best->standard_error);
  }
  return models;
}

}  // namespace calib::inference
