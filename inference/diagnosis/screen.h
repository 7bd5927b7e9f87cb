#pragma once
// Is a fitted model adequate, and if not, the signature of which candidate explains the misfit?
// Matrices in, statistics out. What a signature is and where runs come from: README.md.

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
  std::string name{};                          ///< of the effect
  std::vector<Eigen::VectorXd> differences{};  ///< T each: with minus without the effect, one per
                                               ///< ray and strength tried
  bool two_sided = false;
  /// Of each difference where all lie on one ray, else empty: of either sign, none 0, the farthest
  /// from 0 last, in any unit. What differences of single runs share is the effect, what they do
  /// not is chance.
  std::vector<double> strengths{};
};

struct Adequacy {
  double chi2 = 0;  ///< smallest |W history|^2 over the points, W W^T = covariance^-1
  /// Its expectation were the model right: T - parameters, or the mean over the model's draws.
  double degrees = 0;
  /// The smaller of the two below, times how many independent judgements it is the smallest of: 1 up
  /// to 1 + the number of FittedModel::shapes, as the draws show.
  double p_value = 1;
  /// Of a chi-squared as large; with draws the tail of the gamma law of their mean and variance.
  double p_chi2 = 1;
  /// The smallest of the shapes', each of the residual's square in its span as above; none without.
  std::optional<double> p_shapes{};
  Eigen::Index best = 0;  ///< the point
};

/// One effect judged by its signature.
struct Score {
  std::string name{};
  double gain = 0;       ///< fall of chi2 when the effect may join, all parameters refitted
  double p_value = 1;    ///< of such a fall without the effect
  double adjusted = 1;   ///< p_value by Holm over all candidates
  double explained = 0;  ///< share of ExplainableMisfit() that goes
  double amplitude = 0;  ///< in units of the difference that fits best
  int difference = 0;    ///< which one that is
  double rms = 0;        ///< of the history left, in noise sd
  /// Smallest amplitude of the strongest (the last where strengths are given) difference found with
  /// 90 % power at this test's level, which is two-sided and shared by all differences of all
  /// candidates; infinite when the parameters imitate the effect completely, or differences at two
  /// strengths or more have nothing in common.
  double detectable = 0;
  int detectable_difference = 0;  ///< which one that is
  /// Signatures less than 25 degrees away, nearest first, unless the misfit is so large that the
  /// readings tell them apart all the same.
  std::vector<std::string> confusable_with{};
  /// Between what no choice of the parameters imitates of this signature and of each other one, by
  /// name [degrees], 0 to 90 where either effect is two-sided, else to 180.
  std::map<std::string, double> angles{};
};

struct ScreenOptions {
  int simulations = 500;     ///< of the null, [50, 1e5]; where the model has draws, those instead
  double max_amplitude = 4;  ///< of a difference, > 0
  double level = 0.01;       ///< of the test, (0, 0.5)
  std::uint64_t seed = 0;
};

/// Errors: INVALID_ARGUMENT for shapes that do not fit, a covariance that is not positive definite.
absl::StatusOr<Adequacy> TestAdequacy(const FittedModel& model);

/// Points beside the closest that the readings do not exclude: their chi-squared is above its by no
/// more than the 0.95 quantile of the chi-squared law with model.parameters degrees of freedom
/// [Wilks 1938]. At most `count`, evenly spaced in the order of chi-squared; may be empty. Errors as
/// above.
absl::StatusOr<std::vector<Eigen::Index>> PointsNotExcluded(const FittedModel& model, int count);

/// What of the base model's chi2 an effect may explain: its excess over what a right model has, at
/// least the chance scatter of that (so that nothing explains a misfit that is none).
double ExplainableMisfit(const Adequacy& base);

/// Scores in the order of p_value, then of gain. Deterministic. Errors as above.
absl::StatusOr<std::vector<Score>> Screen(const FittedModel& model,
                                          const std::vector<Signature>& candidates,
                                          const ScreenOptions& options = {});

/// Chance that an extension of the base model fits as much better than it as it does here, were the
/// base model right: fall of the smallest chi2 against its simulated null. extended: has more
/// parameters; its points and the base model's together are what it can do. base: with draws.
/// Errors: INVALID_ARGUMENT as above, without draws, or for an extension without parameters of its
/// own.
absl::StatusOr<double> SignificanceOfGain(const FittedModel& base, const FittedModel& extended);

/// How much better model `a` describes the readings than `b`, in nats of its best log density, and
/// the standard deviation of that by resampling blocks of readings.
struct Advantage {
  double nats = 0;
  double sd = 0;
};
absl::StatusOr<Advantage> Compare(const FittedModel& a, const FittedModel& b, int block = 8);

/// rms over all readings of what the model misses of a group of them when it is fitted to the other
/// groups only, in standard deviations of a measurement: a model that is merely more flexible does
/// not gain by it. group: T entries, of each reading; two groups at least. Errors:
/// INVALID_ARGUMENT.
absl::StatusOr<double> LeftOutError(const FittedModel& model, const std::vector<int>& group);

}  // namespace calib::inference
