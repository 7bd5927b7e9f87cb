#pragma once
// The posterior that a campaign reports: that of the weighted samples (or chains) where those
// suffice, else one sampled on an emulator of their states, else none.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/filter/iterative_filter.h"
#include "server/planning/definition.h"
#include "server/planning/scatter.h"

namespace calib::planning {

struct Answer {
  inference::Posterior weighted;
  const char* weights_source = "weights";  ///< what `weighted` comes from: a word of a source
  Eigen::MatrixXd draws;                   ///< equally weighted, of chains; else empty
  /// SummarizeMembers() of what `weighted` is of.
  std::vector<inference::ParameterSummary> weighted_members{};
  /// Where the weights do not suffice and the states could be emulated, adequately or not.
  std::optional<inference::EmulatedResult> emulated;
  std::vector<ObservableScatter> scatter;  ///< what runs on other packings differ by, where known
  std::vector<double> stage_p;             ///< of StagesOf(), one each; empty: not known
  std::vector<std::string> warnings;       ///< whole sentences
  /// Where runs were placed by what they were expected to bring.
  struct Placed {
    int runs = 0;
    double expected_gain = 0;  ///< part of the variance of the posterior density, [0, 1]
  };
  std::vector<Placed> batches{};

  bool FromWeights() const { return weighted.degeneracy.empty(); }
  bool FromEmulator() const { return emulated.has_value() && emulated->adequate; }
  /// False: no posterior can be given, only the best samples; nothing has converged.
  bool HasIntervals() const { return FromWeights() || FromEmulator(); }
  /// Summaries of the posterior that is reported. Without intervals: the weighted means, everything
  /// else NaN.
  std::vector<inference::ParameterSummary> Parameters() const;
  /// The same of the values of labels.
  std::vector<inference::ParameterSummary> Members(const campaign::Campaign& campaign) const;
};

/// Summaries of the values that parameters per experiment or batch have for each label
/// (campaign/model/population.h), population by population, in the order of their labels; none
/// where there are no populations. draws: n x d in the order of Campaign::parameters, SI;
/// log_weights: n, of weights that sum to one. Pure.
std::vector<inference::ParameterSummary> SummarizeMembers(const campaign::Campaign& campaign,
                                                          const Eigen::MatrixXd& draws,
                                                          const Eigen::VectorXd& log_weights);
/// The same of equally weighted draws.
std::vector<inference::ParameterSummary> SummarizeMembers(const campaign::Campaign& campaign,
                                                          const Eigen::MatrixXd& draws);

/// Adds to the answer what an emulator of the runs gives, and the warnings that go with it.
void AskEmulator(const Definition& definition, std::span<const inference::Iteration> iterations,
                 Answer& answer);

/// What the next samples are proposed from.
struct SearchDraws {
  Eigen::MatrixXd draws;    ///< n x d, SI; no rows: the model is known nowhere in the prior
  Eigen::MatrixXd closest;  ///< m x d: those that half of the samples lie about; none: near already
};

/// Where the weights do not suffice: draws of the answer's emulator, or, where the noise is given
/// and the model far from the readings, of one by errors wider (inference::SearchWidening), with
/// those among them that it expects closest.
SearchDraws DrawsToGoOnFrom(const Definition& definition,
                            std::span<const inference::Iteration> iterations, const Answer& answer);

/// Of the filters. Deterministic. Errors as inference::ComputePosterior; an emulator that cannot be
/// had is no error but a warning.
absl::StatusOr<Answer> FindAnswer(const Definition& definition,
                                  std::span<const inference::Iteration> iterations);

}  // namespace calib::planning
