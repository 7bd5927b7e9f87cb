#pragma once
// How often chi-squared falls as far when a model may do more, though nothing is missing.

#include <vector>

#include "inference/diagnosis/fitted_model.h"

namespace calib::inference {

/// What falls of chi-squared are judged by.
struct Falls {
  std::vector<double> simulated;  ///< of measurements of the model without more, >= 0
  int freedom = 1;        ///< of what a fall is the largest over; of differences of one effect,
                          ///< which are all but parallel, one
  int packings = 0;       ///< see FittedModel
  bool left_out = false;  ///< simulations on a packing are judged without it
};

/// Chance of a fall at least as large, (0, 1]: counted where the simulations reach, beyond the tenth
/// largest of them the tail of a chi-squared that meets them there, or of Fisher's law, where
/// scatter is known from few packings. Where the simulations' own packings are in it, Fisher's about
/// their mean.
double ChanceOfFall(double fall, Falls falls);

/// Standard deviations that ChanceOfFall asks of a measurement along one direction, of either sign,
/// for so small a chance, (0, 1).
double SdAsked(double chance, const FittedModel& model);

}  // namespace calib::inference
