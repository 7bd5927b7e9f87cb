#pragma once
// The models that compete for a measurement, and what they may do before it is seen.

#include <Eigen/Core>
#include <functional>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/design_runs.h"

namespace calib::inference {

/// One model: the base with these effects; or with none and a discrepancy of no known form.
struct EffectModel {
  std::vector<int> effects{};  ///< ascending; none: the base model
  bool none_of_these = false;  ///< base and a discrepancy orthogonal to its sensitivities

  bool operator==(const EffectModel&) const = default;
};

/// What is known of an effect's strength before: log-uniform on [low, high], in the unit of
/// DesignPoints; on [-negative_high, -negative_low] with the same probability where the effect is
/// two-sided.
struct StrengthPrior {
  double low = 0.4, high = 17;                    ///< 0 < low <= high
  double negative_low = 0.4, negative_high = 17;  ///< likewise; of two-sided effects alone
};

/// Prior shares of what a model may lack, normalised on use; equal within each, those of triples
/// among all that there could be. Beside what acts, one effect more acts with odds of one to ten: a
/// pair is one of two effects more, a triple one of three pairs more. Of each single model those
/// with one effect more together so have a tenth of its share, however many effects there are.
/// Chosen on 46 measurements of deploy/bench/hidden-effects, so that sets hold about two effects
/// where lambda is 60; other measurements judge it.
struct PriorShares {
  double adequate = 0.4, singles = 0.4, pairs = singles / 10 / 2, triples = pairs / 10 / 3,
         none_of_these = 0.1;
};

/// What may be before a measurement: effects, priors and models.
struct ModelSpace {
  std::vector<DesignEffect> effects{};        ///< K
  std::vector<StrengthPrior> strength{};      ///< K
  Eigen::VectorXd shape_low{}, shape_high{};  ///< H: shape parameters are uniform between
  Eigen::VectorXd base_low{}, base_high{};    ///< d: base parameters lie between, low < high
  /// ln of the prior's density at n x d base parameters, n entries, up to a constant that all
  /// models share; null: uniform.
  std::function<Eigen::VectorXd(const Eigen::MatrixXd&)> log_base_prior{};
  /// Expected length of a discrepancy, log-uniform: lambda from 4 to 1000, as strengths.
  double tau_low = 2, tau_high = 31.6;
  std::vector<EffectModel> models{};  ///< who competes
  /// How many triples there could be, those among the models included; fewer: as many as these.
  int triples = 0;
  PriorShares shares{};
  /// ln of the prior probability of each model up to a constant; empty: by the shares.
  Eigen::VectorXd log_prior{};

  /// INVALID_ARGUMENT naming what does not fit.
  absl::Status Validate() const;
  /// ln of each model's prior probability.
  Eigen::VectorXd LogPrior() const;
};

/// The base model, every effect, every pair that is not excluded, none of these; in this order.
/// in: excluded, pairs of effects
std::vector<EffectModel> AllModels(int effects, const std::vector<std::pair<int, int>>& excluded);

/// Triples that have one of these pairs and go together, each once, ascending. in: pairs ascending;
/// excluded as of AllModels
std::vector<EffectModel> TriplesOf(int effects, const std::vector<std::pair<int, int>>& excluded,
                                   const std::vector<EffectModel>& pairs);
/// How many triples go together.
int CountTriples(int effects, const std::vector<std::pair<int, int>>& excluded);

/// The points of a model that m points of the unit cube stand for. A cube has base parameters, then
/// strengths (uniform in their logarithm), then shape parameters of the model's effects, or tau.
class ModelCube {
 public:
  /// sign: +1 or -1 for each of the model's effects. in: space that is valid and outlives this
  ModelCube(const ModelSpace& space, const EffectModel& model, std::vector<int> sign);
  Eigen::Index dimensions() const { return dimensions_; }
  DesignPoints Points(const Eigen::MatrixXd& cube) const;
  Eigen::VectorXd Tau(const Eigen::MatrixXd& cube) const;  ///< of none of these alone
  /// ln of the base prior over the uniform one, m entries.
  Eigen::VectorXd LogPrior(const DesignPoints& points) const;

 private:
  const ModelSpace& space_;
  const EffectModel model_;
  std::vector<int> sign_;
  Eigen::Index dimensions_ = 0;
};

/// All choices of sign of a model's effects: 2 to the number of its two-sided ones, equally
/// probable.
std::vector<std::vector<int>> SignsOf(const ModelSpace& space, const EffectModel& model);

}  // namespace calib::inference
