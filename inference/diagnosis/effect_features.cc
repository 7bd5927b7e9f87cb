#include "inference/diagnosis/effect_features.h"

#include <cmath>
#include <utility>

namespace calib::inference {

using Eigen::Index;

EffectFeatures::EffectFeatures(Index parameters, std::vector<DesignEffect> effects, int base_degree)
    : parameters_(parameters), effects_(std::move(effects)) {
  monomials_.push_back({.parent = -1, .variable = 0, .degree = 0});
  // Each monomial once: its variables in ascending order.
  for (std::size_t m = 0; m < monomials_.size(); ++m) {
    const Monomial parent = monomials_[m];
    for (int j = parent.variable; parent.degree < base_degree && j < parameters; ++j) {
      monomials_.push_back(
          {.parent = static_cast<int>(m), .variable = j, .degree = parent.degree + 1});
    }
  }
  for (int degree = 0; degree <= base_degree; ++degree)
    groups_.push_back({.kind = FeatureKind::kBase, .number = degree});
  for (const Monomial& monomial : monomials_) group_of_.push_back(monomial.degree);

  count_ = base_count();
  for (int k = 0; k < static_cast<int>(effects_.size()); ++k) {
    const int shapes = effects_[static_cast<std::size_t>(k)].shapes;
    const auto add = [&](FeatureKind kind, Index n) {
      if (n == 0) return;
      groups_.push_back({.kind = kind, .number = k});
      group_of_.insert(group_of_.end(), static_cast<std::size_t>(n),
                       static_cast<int>(groups_.size()) - 1);
    };
    add(FeatureKind::kMain, 1);
    add(FeatureKind::kInteraction, parameters);
    add(FeatureKind::kCurvature, 1);
    add(FeatureKind::kCurvatureByBase, parameters);
    add(FeatureKind::kShape, shapes * (3 + parameters));
    const Index columns = 2 * (1 + parameters) + shapes * (3 + parameters);
    blocks_.push_back({.first = count_, .count = columns});
    first_shape_.push_back(shape_count_);
    count_ += columns;
    shape_count_ += shapes;
  }
}

int EffectFeatures::DegreeFor(Index parameters, Index runs) {
  int degree = 0;
  for (Index terms = 1; degree < 4; ++degree) {
    // (d + g)! / (d! g!) monomials up to degree g
    terms = terms * (parameters + degree + 1) / (degree + 1);
    if (4 * terms > runs) break;
  }
  return degree;
}

Eigen::MatrixXd EffectFeatures::Base(const Eigen::MatrixXd& base) const {
  Eigen::MatrixXd result(base.rows(), base_count());
  result.col(0).setOnes();
  for (Index m = 1; m < base_count(); ++m) {
    const Monomial& monomial = monomials_[static_cast<std::size_t>(m)];
    result.col(m) = result.col(monomial.parent).cwiseProduct(base.col(monomial.variable));
  }
  return result;
}

Eigen::MatrixXd EffectFeatures::BaseDerivative(const Eigen::MatrixXd& base, Index j) const {
  const Eigen::MatrixXd value = Base(base);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(base.rows(), base_count());
  for (Index m = 1; m < base_count(); ++m) {
    const Monomial& monomial = monomials_[static_cast<std::size_t>(m)];
    result.col(m) = result.col(monomial.parent).cwiseProduct(base.col(monomial.variable));
    if (monomial.variable == j) result.col(m) += value.col(monomial.parent);
  }
  return result;
}

Eigen::VectorXd EffectFeatures::Amplitude(int effect, const Eigen::VectorXd& strength) const {
  const double power = effects_[static_cast<std::size_t>(effect)].power;
  return strength.unaryExpr(
      [power](double s) { return s == 0 ? 0.0 : std::copysign(std::pow(std::abs(s), power), s); });
}

Eigen::MatrixXd EffectFeatures::Effect(int effect, const DesignPoints& points) const {
  const DesignEffect& e = effects_[static_cast<std::size_t>(effect)];
  const Eigen::VectorXd f = Amplitude(effect, points.strength.col(effect));
  const Eigen::VectorXd c = f.cwiseProduct(f) / std::pow(3.0, e.power);
  Eigen::MatrixXd result(points.rows(), block(effect).count);
  Index column = 0;
  result.col(column++) = f;
  for (Index j = 0; j < parameters_; ++j) result.col(column++) = f.cwiseProduct(points.base.col(j));
  result.col(column++) = c;
  for (Index j = 0; j < parameters_; ++j) result.col(column++) = c.cwiseProduct(points.base.col(j));
  for (int h = 0; h < e.shapes; ++h) {
    const Eigen::VectorXd t = points.shape.col(first_shape(effect) + h);
    const Eigen::VectorXd ft = f.cwiseProduct(t);
    result.col(column++) = ft;
    result.col(column++) = ft.cwiseProduct(t);
    result.col(column++) = c.cwiseProduct(t);
    for (Index j = 0; j < parameters_; ++j)
      result.col(column++) = ft.cwiseProduct(points.base.col(j));
  }
  return result;
}

Eigen::MatrixXd EffectFeatures::All(const DesignPoints& points) const {
  Eigen::MatrixXd result(points.rows(), count_);
  result.leftCols(base_count()) = Base(points.base);
  for (int k = 0; k < static_cast<int>(effects_.size()); ++k)
    result.middleCols(block(k).first, block(k).count) = Effect(k, points);
  return result;
}

Eigen::MatrixXd EffectFeatures::VarianceTerms(const DesignPoints& points) const {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(points.rows(), 2);
  for (int k = 0; k < static_cast<int>(effects_.size()); ++k) {
    if (effects_[static_cast<std::size_t>(k)].calculated) continue;
    const Eigen::VectorXd f = Amplitude(k, points.strength.col(k));
    const Eigen::VectorXd square = f.cwiseProduct(f);
    result.col(1) += square.cwiseProduct(result.col(0));
    result.col(0) += square;
  }
  return result;
}

bool EffectFeatures::Fits(const DesignPoints& points) const {
  const Index n = points.rows();
  return points.base.cols() == parameters_ && points.strength.rows() == n &&
         points.strength.cols() == static_cast<Index>(effects_.size()) &&
         points.shape.rows() == n && points.shape.cols() == shape_count_ &&
         points.base.allFinite() && points.strength.allFinite() && points.shape.allFinite();
}

}  // namespace calib::inference
