#pragma once
// Runs of a design: one parameter set each, with few of K effects on, through all tests of a set.
// Plain values.

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace calib::inference {

/// An effect as an emulator sees it. Strengths are in units that the caller chooses, best of what
/// can just be seen (lambda = 21); 0 is the null.
struct DesignEffect {
  /// p > 0: what the effect does grows as f = sign(s) |s|^p from the null on.
  double power = 1;
  bool two_sided = false;  ///< whether strengths may be negative
  int shapes = 0;          ///< parameters of its shape, >= 0
  /// Whether it is calculated on curves: what it does is known without the scatter of runs.
  bool calculated = false;
};

/// n points in the space of base parameters, strengths and shapes. K effects with H shape
/// parameters together, which stand in the order of their effects.
struct DesignPoints {
  Eigen::MatrixXd base{};      ///< n x d: base parameters, scaled to about [-1, 1]
  Eigen::MatrixXd strength{};  ///< n x K
  Eigen::MatrixXd shape{};     ///< n x H, scaled to about [-1, 1]; no meaning where it is off

  Eigen::Index rows() const { return base.rows(); }
};

/// Points where an effect that is calculated on curves was turned on, and what that changed.
struct CalculatedDifferences {
  DesignPoints with{}, without{};  ///< D points each
  Eigen::MatrixXd outputs{};       ///< D rows: with minus without, of histories or of coordinates
};

/// The rows of these numbers.
inline DesignPoints RowsOf(const DesignPoints& points, const std::vector<Eigen::Index>& rows) {
  return {.base = points.base(rows, Eigen::all),
          .strength = points.strength(rows, Eigen::all),
          .shape = points.shape(rows, Eigen::all)};
}

/// Columns of points that an emulator of fewer effects has, ascending; none: it has all.
struct PointColumns {
  std::vector<Eigen::Index> strength{}, shape{};
};
using PartOfColumns = std::optional<PointColumns>;

/// The points as that emulator takes them.
inline DesignPoints ColumnsOf(const DesignPoints& points, const PartOfColumns& part) {
  if (!part) return points;
  return {.base = points.base,
          .strength = points.strength(Eigen::all, part->strength),
          .shape = points.shape(Eigen::all, part->shape)};
}

/// The same points without effects.
inline DesignPoints WithoutEffects(DesignPoints points) {
  points.strength.setZero();
  return points;
}

}  // namespace calib::inference
