#pragma once
// The shape of what a model leaves unexplained along a curve, in one word and one number.

#include <Eigen/Core>

namespace calib::report {

/// Readings of one observable in the order of loading.
struct ResidualCurve {
  Eigen::VectorXd residual;     ///< model - measurement
  Eigen::VectorXd sd;           ///< standard deviation of the error of each reading, > 0
  Eigen::VectorXd correlation;  ///< of errors i - 1 and i, in [0, 1); first: unused
  Eigen::VectorXd control;
  Eigen::VectorXd model;
};

/// A bias or a shape is called clear beyond this many of its standard deviations.
constexpr double kClear = 3;

/// The shapes that have a name, with the unit of their size.
enum class ResidualShape {
  kNone,       ///< what is left is noise (p of chi-squared above 0.01)
  kOffset,     ///< residual = size                                       [observable]
  kSlope,      ///< residual = size (control - its mean)                  [observable / control]
  kAmplitude,  ///< residual = size model                                 [-]
  /// residual = -size d model / d control: the model answers later by `size`  [control]
  kLag,
  kIrregular  ///< none of these makes up half of the excess
};
/// "none", "offset", "slope", "amplitude", "lag", "irregular"
const char* ToString(ResidualShape shape);

struct ResidualPattern {
  ResidualShape shape = ResidualShape::kNone;
  double size = 0;       ///< by weighted least squares; 0 with kNone and kIrregular
  double z = 0;          ///< size over its standard deviation
  double explained = 0;  ///< share of chi-squared beyond the number of readings that it takes away
};

/// The shape that takes away most of chi-squared; the first of two that are as good. Pure; three
/// readings or more, otherwise none.
ResidualPattern PatternOf(const ResidualCurve& curve);

/// Coordinates in which the errors are independent with unit variance:
///   (u_i - c_i u_{i-1}) / sqrt(1 - c_i^2),  u = x / sd.
/// Errors correlated as exp(-distance / length) are such a chain.
Eigen::VectorXd Whitened(const ResidualCurve& curve, const Eigen::VectorXd& x);

}  // namespace calib::report
