#pragma once
// What a model can do, in as few numbers per point as it takes.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// G histories over T readings, each a sum of q shapes. An emulator predicts thousands of points
/// from a dozen components: what is done to all points costs q per point and not T, or T^2.
class Histories {
 public:
  Histories() = default;
  /// values: G x T, as they are. Not explicit: a matrix of histories is one.
  template <typename Values>
  Histories(const Eigen::MatrixBase<Values>& values) {  // NOLINT(google-explicit-constructor)
    SetValues(values);
  }
  /// shapes: T x q; coefficients: q x G.
  Histories(Eigen::MatrixXd shapes, Eigen::MatrixXd coefficients);

  Eigen::Index points() const { return coefficients_.cols(); }
  Eigen::Index readings() const { return shapes_.rows(); }
  const Eigen::MatrixXd& shapes() const { return shapes_; }
  const Eigen::MatrixXd& coefficients() const { return coefficients_; }

  /// History of one point, T.
  Eigen::VectorXd operator[](Eigen::Index point) const;
  /// Root mean square over the readings.
  double Rms(Eigen::Index point) const;
  /// G x T.
  Eigen::MatrixXd Values() const;
  /// The same points at some of the readings.
  Histories At(const std::vector<Eigen::Index>& readings) const;
  bool AllFinite() const;

 private:
  void SetValues(const Eigen::MatrixXd& values);

  Eigen::MatrixXd shapes_;
  Eigen::MatrixXd coefficients_;
};

}  // namespace calib::inference
