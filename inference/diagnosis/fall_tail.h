#pragma once
// How often chi-squared falls as far when a model may do more, though nothing is missing. Pure
// functions.

#include <vector>

#include "inference/diagnosis/fitted_model.h"

namespace calib::inference {

/// What a fall of chi-squared is judged by.
struct Falls {
  std::vector<double> simulated;  ///< falls for measurements of the model without more, >= 0
  /// Degrees of freedom of the law of a fall: what was added may do, >= 1; 1 where a fall is the
  /// largest over differences of one effect, which are all but parallel.
  int freedom = 1;
  int packings = 0;       ///< FittedModel::packings
  bool left_out = false;  ///< simulations on a packing are judged by a covariance without it
};

/// Chance of a fall at least as large as `fall`, (0, 1]: counted where the simulations reach,
/// beyond the tenth largest of them the tail of a chi-squared that meets them there, or of Fisher's
/// law where scatter is known from few packings. Where the covariance knows the simulations' own
/// packings: Fisher's law about their mean. These are laws of the falls above zero; those that are
/// zero, half of them where the one thing added has one sign, are a point mass beside.
/// [Chernoff, Ann. Math. Stat. 25 (1954) 573; Self & Liang, J. Am. Stat. Assoc. 82 (1987) 605]
double ChanceOfFall(double fall, Falls falls);

/// How many standard deviations a measurement must lie off along one direction, to either side, for
/// ChanceOfFall to be as small as `chance`, (0, 1).
double SdAsked(double chance, const FittedModel& model);

}  // namespace calib::inference
