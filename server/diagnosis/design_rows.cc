#include "server/diagnosis/design_rows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// Of a prior without bounds: what lies farther out is one run in five hundred.
constexpr double kTailOfShape = 0.001;

// Middle and half of the range of a shape parameter, in the standard coordinate of its prior.
std::pair<double, double> RangeOfShape(const inference::Prior& prior) {
  const double low = prior.ToStandard(prior.Quantile(kTailOfShape));
  const double high = prior.ToStandard(prior.Quantile(1 - kTailOfShape));
  return {0.5 * (low + high), 0.5 * (high - low)};
}

}  // namespace

Eigen::MatrixXd BaseAxes::Scaled(const Eigen::MatrixXd& values) const {
  Eigen::MatrixXd scaled(values.rows(), values.cols());
  for (Index j = 0; j < values.cols(); ++j) {
    const inference::Prior& prior = priors[static_cast<std::size_t>(j)];
    for (Index i = 0; i < values.rows(); ++i)
      scaled(i, j) = (prior.ToStandard(values(i, j)) - middle[j]) / half[j];
  }
  return scaled;
}

Eigen::MatrixXd BaseAxes::Values(const Eigen::MatrixXd& scaled) const {
  Eigen::MatrixXd values(scaled.rows(), scaled.cols());
  for (Index j = 0; j < scaled.cols(); ++j) {
    const inference::Prior& prior = priors[static_cast<std::size_t>(j)];
    for (Index i = 0; i < scaled.rows(); ++i) {
      values(i, j) =
          std::clamp(prior.FromStandard(middle[j] + half[j] * scaled(i, j)), prior.min, prior.max);
    }
  }
  return values;
}

BaseAxes BaseAxes::Narrowed(const Eigen::VectorXd& low, const Eigen::VectorXd& high) const {
  return {.priors = priors,
          .middle = middle + 0.5 * half.cwiseProduct(low + high),
          .half = 0.5 * half.cwiseProduct(high - low)};
}

BaseAxes AxesOver(std::vector<inference::Prior> priors, const Eigen::MatrixXd& values) {
  const auto d = static_cast<Index>(priors.size());
  BaseAxes axes{.priors = std::move(priors),
                .middle = Eigen::VectorXd::Zero(d),
                .half = Eigen::VectorXd::Ones(d)};
  const Eigen::MatrixXd standard = axes.Scaled(values);
  const Eigen::VectorXd low = standard.colwise().minCoeff(), high = standard.colwise().maxCoeff();
  axes.middle = 0.5 * (low + high);
  for (Index j = 0; j < d; ++j) axes.half[j] = high[j] > low[j] ? 0.5 * (high[j] - low[j]) : 1;
  return axes;
}

DesignRows::DesignRows(BaseAxes axes, Race race, Eigen::VectorXd unit)
    : axes_(std::move(axes)), race_(std::move(race)), unit_(std::move(unit)), names_(race_.base) {
  for (const RacingEffect& entry : race_.effects) {
    names_.push_back(entry.strength);
    first_shape_.push_back(shape_count_);
    for (const ShapeParameter& shape : entry.shapes) names_.push_back(shape.name);
    shape_count_ += entry.design.shapes;
  }
  for (const NumericalChoice& choice : race_.numerics) names_.push_back(choice.name);
}

DesignRows DesignRows::EndingAt(const Eigen::VectorXd& most,
                                const Eigen::VectorXd& most_other) const {
  Race race = race_;
  for (std::size_t k = 0; k < race.effects.size(); ++k) {
    RacingEffect& entry = race.effects[k];
    const auto i = static_cast<Index>(k);
    entry.ends = entry.ends && most[i] >= entry.most;
    entry.other_ends = entry.other_ends && most_other[i] >= entry.most_other;
    entry.most = std::min(entry.most, most[i]);
    entry.most_other = std::min(entry.most_other, most_other[i]);
  }
  return {axes_, std::move(race), unit_};
}

double DesignRows::SignOf(int entry) const {
  return race_.effects[static_cast<std::size_t>(entry)].near > 0 ? 1 : -1;
}

Eigen::VectorXd DesignRows::Most() const {
  Eigen::VectorXd result(unit_.size());
  for (Index k = 0; k < result.size(); ++k)
    result[k] = race_.effects[static_cast<std::size_t>(k)].most / unit_[k];
  return result;
}

Eigen::VectorXd DesignRows::MostOther() const {
  Eigen::VectorXd result(unit_.size());
  for (Index k = 0; k < result.size(); ++k)
    result[k] = race_.effects[static_cast<std::size_t>(k)].most_other / unit_[k];
  return result;
}

std::vector<double> DesignRows::Values(const inference::DesignPoints& points, Index row) const {
  const Eigen::MatrixXd base = axes_.Values(points.base.row(row));
  std::vector<double> values(base.data(), base.data() + base.size());
  for (int k = 0; k < static_cast<int>(race_.effects.size()); ++k) {
    const RacingEffect& entry = race_.effects[static_cast<std::size_t>(k)];
    const double strength = points.strength(row, k);
    const double distance = std::clamp(strength * unit_[k], -entry.most_other, entry.most);
    values.push_back(strength == 0 ? entry.null : entry.null + SignOf(k) * distance);
    for (int h = 0; h < entry.design.shapes; ++h) {
      const ShapeParameter& shape = entry.shapes[static_cast<std::size_t>(h)];
      const auto [middle, half] = RangeOfShape(shape.prior);
      double value = shape.absent;
      if (strength != 0) {
        value = std::clamp(
            shape.prior.FromStandard(middle + half * points.shape(row, first_shape(k) + h)),
            shape.prior.min, shape.prior.max);
        if (shape.whole) value = std::round(value);
      }
      values.push_back(value);
    }
  }
  for (const NumericalChoice& choice : race_.numerics) values.push_back(choice.null);
  return values;
}

std::vector<double> DesignRows::WithoutEffects() const {
  return Values({.base = Eigen::MatrixXd::Zero(1, axes_.middle.size()),
                 .strength = Eigen::MatrixXd::Zero(1, unit_.size()),
                 .shape = Eigen::MatrixXd::Zero(1, shape_count_)},
                0);
}

inference::DesignPoints DesignRows::Points(const std::vector<std::vector<double>>& rows) const {
  const auto n = static_cast<Index>(rows.size()), d = static_cast<Index>(race_.base.size());
  const auto count = static_cast<int>(race_.effects.size());
  inference::DesignPoints points{.base = Eigen::MatrixXd(n, d),
                                 .strength = Eigen::MatrixXd(n, count),
                                 .shape = Eigen::MatrixXd::Zero(n, shape_count_)};
  for (Index i = 0; i < n; ++i) {
    const std::vector<double>& values = rows[static_cast<std::size_t>(i)];
    for (Index j = 0; j < d; ++j) points.base(i, j) = values[static_cast<std::size_t>(j)];
    auto place = static_cast<std::size_t>(d);
    for (int k = 0; k < count; ++k) {
      const RacingEffect& entry = race_.effects[static_cast<std::size_t>(k)];
      const double distance = SignOf(k) * (values[place++] - entry.null);
      points.strength(i, k) = distance / unit_[k];
      for (int h = 0; h < entry.design.shapes; ++h, ++place) {
        if (distance == 0) continue;
        const inference::Prior& prior = entry.shapes[static_cast<std::size_t>(h)].prior;
        const auto [middle, half] = RangeOfShape(prior);
        points.shape(i, first_shape(k) + h) = (prior.ToStandard(values[place]) - middle) / half;
      }
    }
  }
  points.base = axes_.Scaled(points.base);
  return points;
}

int DesignRows::ChangedNumerics(const std::vector<double>& values) const {
  const std::size_t first = names_.size() - race_.numerics.size();
  for (std::size_t c = 0; c < race_.numerics.size(); ++c) {
    if (values[first + c] != race_.numerics[c].null) return static_cast<int>(c);
  }
  return -1;
}

std::vector<double> DesignRows::WithoutNumerics(std::vector<double> values) const {
  const std::size_t first = names_.size() - race_.numerics.size();
  for (std::size_t c = 0; c < race_.numerics.size(); ++c)
    values[first + c] = race_.numerics[c].null;
  return values;
}

std::vector<double> DesignRows::WithNumerics(std::vector<double> values, int choice) const {
  const std::size_t first = names_.size() - race_.numerics.size();
  const auto c = static_cast<std::size_t>(choice);
  values[first + c] = race_.numerics[c].tried;
  return values;
}

}  // namespace calib::diagnosis
