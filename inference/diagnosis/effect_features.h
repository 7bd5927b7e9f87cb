#pragma once
// What an additive emulator is linear in: a polynomial of the base parameters, and for each effect
// a few functions of its strength that are zero at the null.

#include <Eigen/Core>
#include <vector>

#include "inference/diagnosis/design_runs.h"

namespace calib::inference {

/// What a feature is; features of one kind and effect have one prior variance (FeatureGroup).
enum class FeatureKind {
  kBase,             ///< a monomial of the base parameters
  kMain,             ///< f
  kInteraction,      ///< f x_j
  kCurvature,        ///< c = f^2 / 3^p, of order one at three units
  kCurvatureByBase,  ///< c x_j
  kShape,            ///< f t, f t^2, c t, f t x_j of each shape parameter t
};

/// Features that share a prior variance.
struct FeatureGroup {
  FeatureKind kind = FeatureKind::kBase;
  int number = 0;  ///< degree of the monomials, or index of the effect
};

/// Columns of one effect.
struct FeatureBlock {
  Eigen::Index first = 0, count = 0;
};

/// The P features of d base parameters and K effects: the monomials up to a degree, then a block
/// for each effect. All runs are data for the base part, since the blocks of effects that are off
/// are exactly zero. Immutable; thread safety: const.
class EffectFeatures {
 public:
  /// in: parameters d >= 1; base_degree >= 0
  EffectFeatures(Eigen::Index parameters, std::vector<DesignEffect> effects, int base_degree);

  /// Largest degree, at most 4, whose monomials of d parameters number no more than a quarter of
  /// the runs: with four runs a coefficient its prior does not matter.
  static int DegreeFor(Eigen::Index parameters, Eigen::Index runs);

  Eigen::Index parameters() const { return parameters_; }  ///< d
  Eigen::Index count() const { return count_; }            ///< P
  Eigen::Index base_count() const {                        ///< P0
    return static_cast<Eigen::Index>(monomials_.size());
  }
  Eigen::Index shape_count() const { return shape_count_; }  ///< H
  const std::vector<DesignEffect>& effects() const { return effects_; }
  const FeatureBlock& block(int effect) const { return blocks_[static_cast<std::size_t>(effect)]; }
  const std::vector<FeatureGroup>& groups() const { return groups_; }
  /// P: for each feature its place in groups().
  const std::vector<int>& group_of() const { return group_of_; }
  /// First column of DesignPoints::shape that belongs to the effect.
  Eigen::Index first_shape(int effect) const {
    return first_shape_[static_cast<std::size_t>(effect)];
  }

  /// The monomials at n x d base parameters, n x P0.
  Eigen::MatrixXd Base(const Eigen::MatrixXd& base) const;
  /// Their derivatives by parameter j, n x P0.
  Eigen::MatrixXd BaseDerivative(const Eigen::MatrixXd& base, Eigen::Index j) const;
  /// The effect's block at the points, n x block(effect).count; zero where it is off.
  Eigen::MatrixXd Effect(int effect, const DesignPoints& points) const;
  /// All features, n x P.
  Eigen::MatrixXd All(const DesignPoints& points) const;
  /// f of each of n strengths.
  Eigen::VectorXd Amplitude(int effect, const Eigen::VectorXd& strength) const;
  /// n x 2: sum of f_k^2, and sum of f_k^2 f_l^2 over pairs, of effects that are not calculated.
  Eigen::MatrixXd VarianceTerms(const DesignPoints& points) const;
  /// Whether the points have as many columns as these features ask for, and all are finite.
  bool Fits(const DesignPoints& points) const;

 private:
  struct Monomial {
    int parent, variable, degree;  // parent times a variable; the constant has neither
  };

  Eigen::Index parameters_, count_ = 0, shape_count_ = 0;
  std::vector<DesignEffect> effects_;
  std::vector<Monomial> monomials_;
  std::vector<FeatureBlock> blocks_;
  std::vector<Eigen::Index> first_shape_;
  std::vector<FeatureGroup> groups_;
  std::vector<int> group_of_;
};

}  // namespace calib::inference
