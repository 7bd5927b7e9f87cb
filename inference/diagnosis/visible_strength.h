#pragma once
// How well a measurement shows an effect, by an emulator's means. Pure functions.

#include <Eigen/Core>
#include <vector>

#include "inference/diagnosis/diagnosis_set.h"
#include "inference/diagnosis/model_space.h"

namespace calib::inference {

/// lambda: squared distance of the means at one point from those of the nearest base model in the
/// box of the space, over the sets, in sd of a measurement (share of scatter, noise). Gauss-Newton
/// from the point's own base parameters and from the nearest of a net. in: point, 1 row
double SquaredDistanceFromBase(const std::vector<const DiagnosisSet*>& sets,
                               const ModelSpace& space, const DesignPoints& point);

/// Smallest strength, at this sign, at which lambda reaches `lambda` at base parameters `base` (d)
/// with shape parameters at 0: on a geometric grid of 33 strengths from a hundredth of `largest`
/// on, interpolated in logarithms; `largest` where it is not reached.
struct StrengthQuestion {
  int effect = 0;
  int sign = 1;
  double lambda = 21;   ///< > 0: seen with a chance of 0.9 among 17 effects
  double largest = 17;  ///< > 0, in the unit of DesignPoints
};
double StrengthOfLambda(const std::vector<const DiagnosisSet*>& sets, const ModelSpace& space,
                        const Eigen::RowVectorXd& base, const StrengthQuestion& question);

/// Angles between the effects' signatures, K x K in degrees: what each changes at base parameters
/// `base` (d) at strengths `strength` (K, not 0), in sd of a measurement, freed of the
/// sensitivities. Of two-sided effects the smaller of both angles. 90 where a signature is zero.
Eigen::MatrixXd SignatureAngles(const std::vector<const DiagnosisSet*>& sets,
                                const Eigen::RowVectorXd& base, const Eigen::VectorXd& strength);

}  // namespace calib::inference
