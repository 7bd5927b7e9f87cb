#pragma once
// What a model can do, in as few numbers per point as it takes.

#include <Eigen/Core>
#include <vector>

namespace calib::inference {

/// G histories over T readings, each a sum of q shapes. An emulator predicts thousands of points
/// from a dozen components: what is done to all points costs q per point and not T, or T^2. A
/// value; thread safety: const.
class Histories {
 public:
  Histories() = default;
  /// Histories of these values, G x T. Not explicit: a matrix of histories is one.
  template <typename Values>
  Histories(const Eigen::MatrixBase<Values>& values) {  // NOLINT(google-explicit-constructor)
    SetValues(values);
  }
  /// Histories of shapes (T x q) times coefficients (q x G).
  Histories(Eigen::MatrixXd shapes, Eigen::MatrixXd coefficients);

  Eigen::Index points() const { return coefficients_.cols(); }           ///< G
  Eigen::Index readings() const { return shapes_.rows(); }               ///< T
  const Eigen::MatrixXd& shapes() const { return shapes_; }              ///< T x q
  const Eigen::MatrixXd& coefficients() const { return coefficients_; }  ///< q x G

  /// History of a point, T entries.
  Eigen::VectorXd operator[](Eigen::Index point) const;
  /// Root mean square of a point's history over the readings.
  double Rms(Eigen::Index point) const;
  /// All histories, G x T.
  Eigen::MatrixXd Values() const;
  /// The histories of all points at some of the readings.
  Histories At(const std::vector<Eigen::Index>& readings) const;
  /// Whether shapes and coefficients are finite.
  bool AllFinite() const;

 private:
  void SetValues(const Eigen::MatrixXd& values);

  Eigen::MatrixXd shapes_;
  Eigen::MatrixXd coefficients_;
};

}  // namespace calib::inference
