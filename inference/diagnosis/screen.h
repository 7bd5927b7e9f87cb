#pragma once
// Is a fitted model adequate, and if not, the signature of which candidate effect explains the
// misfit? Matrices in, statistics out: the signature of an effect is what it changes of the
// histories, runs with minus runs without it. The misfit is the smallest chi-squared over the
// points of the model, so that its parameters are refitted whatever a candidate adds. Pure
// functions. T readings throughout, histories in units of their noise sd.

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/fitted_model.h"

namespace calib::inference {

/// How an effect would change the histories.
struct Signature {
  std::string name{};  ///< of the effect
  /// T each: history with minus history without the effect, one for each direction of the effect's
  /// parameters (ray) and strength along it that was tried.
  std::vector<Eigen::VectorXd> differences{};
  bool two_sided = false;  ///< whether the effect may also act the other way round
  /// For each difference its strength, where all lie on one ray; else empty. Of either sign, none
  /// 0, the farthest from 0 last, in any unit. What differences of single runs share is the effect,
  /// what they do not is chance.
  std::vector<double> strengths{};
};

/// Whether a model fits as well as a right one would.
struct Adequacy {
  double chi2 = 0;  ///< smallest |W history|^2 over the points, W^T W = covariance^-1
  /// Expectation of chi2 were the model right: T - parameters, or the mean over the model's draws.
  double degrees = 0;
  /// The smaller of p_chi2 and p_shapes, times how many independent judgements it is the smallest
  /// of: 1 up to 1 + the number of FittedModel::shapes, as the draws show.
  double p_value = 1;
  /// Chance of a chi2 as large of a right model: by the chi-squared law; with draws, by DrawnTail.
  double p_chi2 = 1;
  /// Smallest chance over FittedModel::shapes of a residual whose square in the shapes' span is as
  /// large, by DrawnTail; none without shapes.
  std::optional<double> p_shapes{};
  Eigen::Index best = 0;  ///< the point of the smallest chi2
};

/// One effect judged by its signature.
struct Score {
  std::string name{};    ///< of the effect
  double gain = 0;       ///< fall of chi2 when the effect may join, all parameters refitted
  double p_value = 1;    ///< chance of such a fall were the effect absent
  double adjusted = 1;   ///< p_value adjusted over all candidates [Holm 1979]
  double explained = 0;  ///< share of ExplainableMisfit that the effect takes away, [0, 1]
  double amplitude = 0;  ///< of the effect, in units of the difference that fits best
  int difference = 0;    ///< index of the difference that fits best
  double rms = 0;        ///< root mean square of the history left, in noise sd
  /// Smallest amplitude of the strongest (the last where strengths are given) difference found with
  /// 90 % power at this test's level, which is two-sided and shared by all differences of all
  /// candidates; infinite when the parameters imitate the effect completely, or differences at two
  /// strengths or more have nothing in common.
  double detectable = 0;
  int detectable_difference = 0;  ///< index of the difference that `detectable` is in units of
  /// Signatures less than 25 degrees away, nearest first, unless the misfit is so large that the
  /// readings tell them apart all the same.
  std::vector<std::string> confusable_with{};
  /// Between what no choice of the parameters imitates of this signature and of each other one, by
  /// name [degrees], 0 to 90 where either effect is two-sided, else to 180.
  std::map<std::string, double> angles{};
};

/// Options of Screen; defaults are chosen.
struct ScreenOptions {
  /// Measurements simulated without any effect, [50, 1e5]; where the model has draws, those
  /// instead.
  int simulations = 500;
  double max_amplitude = 4;  ///< of an effect, in units of a difference, > 0
  double level = 0.01;       ///< of the test behind Score::detectable, (0, 0.5)
  std::uint64_t seed = 0;
};

/// Judges the model by itself. Errors: INVALID_ARGUMENT for histories, draws or shapes that do not
/// fit, draws that do not vary, a covariance that is not positive definite.
absl::StatusOr<Adequacy> TestAdequacy(const FittedModel& model);

/// Points beside the closest that the readings do not exclude: their chi-squared is above that of
/// the closest by no more than the 0.95 quantile of the chi-squared law with model.parameters
/// degrees of freedom [Wilks 1938]. At most `count`, evenly spaced in the order of chi-squared; may
/// be empty. Errors: INVALID_ARGUMENT as TestAdequacy.
absl::StatusOr<std::vector<Eigen::Index>> PointsNotExcluded(const FittedModel& model, int count);

/// What of a model's chi2 an effect may explain: its excess over what a right model has, at least
/// the standard deviation of that by chance, sqrt(2 degrees), so that nothing explains a misfit
/// that is none.
double ExplainableMisfit(const Adequacy& base);

/// Scores of all candidates in the order of p_value, then of gain. Deterministic in options.seed.
/// Errors: INVALID_ARGUMENT as TestAdequacy, or for a signature that does not fit the histories.
absl::StatusOr<std::vector<Score>> Screen(const FittedModel& model,
                                          const std::vector<Signature>& candidates,
                                          const ScreenOptions& options = {});

/// Chance that an extension of the base model fits as much better than it as it does here, were the
/// base model right: the fall of the smallest chi2 against falls for the base model's draws.
/// in: base, with draws; extended, has more parameters, and its points and the base model's
///     together are what it can do
/// Errors: INVALID_ARGUMENT as TestAdequacy, without draws, or for an extension without parameters
/// of its own.
absl::StatusOr<double> SignificanceOfGain(const FittedModel& base, const FittedModel& extended);

/// How much better one model describes the readings than another.
struct Advantage {
  double nats = 0;  ///< difference of their best log densities
  double sd = 0;    ///< standard deviation of that by resampling blocks of readings
};

/// The advantage of model `a` over `b` for the same readings; block: readings resampled together,
/// >= 1, fewer where there would be less than eight blocks. Errors: INVALID_ARGUMENT as
/// TestAdequacy, or for models of different readings.
absl::StatusOr<Advantage> Compare(const FittedModel& a, const FittedModel& b, int block = 8);

/// Root mean square over all readings of what the model misses of a group of them when it is fitted
/// to the other groups only, in standard deviations of a measurement: a model that is merely more
/// flexible does not gain by it. group: T numbers of any value, equal for readings of a group, two
/// groups at least. Errors: INVALID_ARGUMENT as TestAdequacy, or for fewer than two groups.
absl::StatusOr<double> LeftOutError(const FittedModel& model, const std::vector<int>& group);

}  // namespace calib::inference
