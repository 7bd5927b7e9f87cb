#include "inference/diagnosis/model_space.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Adequate, singles, pairs, triples, none of these.
std::size_t ShareOf(const EffectModel& model) {
  return model.none_of_these ? 4 : model.effects.size();
}

Index ShapesBefore(const ModelSpace& space, int effect) {
  Index first = 0;
  for (int k = 0; k < effect; ++k) first += space.effects[static_cast<std::size_t>(k)].shapes;
  return first;
}

bool ValidRange(double low, double high) {
  return std::isfinite(low) && std::isfinite(high) && low > 0 && high >= low;
}

}  // namespace

absl::Status ModelSpace::Validate() const {
  const auto k = static_cast<int>(effects.size());
  if (static_cast<int>(strength.size()) != k)
    return absl::InvalidArgumentError("as many strength priors as effects are asked for");
  for (int e = 0; e < k; ++e) {
    const StrengthPrior& s = strength[static_cast<std::size_t>(e)];
    if (!ValidRange(s.low, s.high) || (effects[static_cast<std::size_t>(e)].two_sided &&
                                       !ValidRange(s.negative_low, s.negative_high))) {
      return absl::InvalidArgumentError(absl::StrCat("strengths of effect ", e, " range from ",
                                                     s.low, " to ", s.high,
                                                     "; 0 < low <= high is asked for"));
    }
  }
  const Index h = ShapesBefore(*this, k);
  if (shape_low.size() != h || shape_high.size() != h || !shape_low.allFinite() ||
      !shape_high.allFinite() || (shape_high.array() < shape_low.array()).any())
    return absl::InvalidArgumentError("ranges of shape parameters do not fit the effects");
  if (base_low.size() == 0 || base_high.size() != base_low.size() || !base_low.allFinite() ||
      !base_high.allFinite() || !((base_high - base_low).minCoeff() > 0))
    return absl::InvalidArgumentError("base parameters have no range");
  if (!ValidRange(tau_low, tau_high)) return absl::InvalidArgumentError("tau has no range");
  if (models.empty()) return absl::InvalidArgumentError("no model competes");
  for (const EffectModel& model : models) {
    const std::set<int> each(model.effects.begin(), model.effects.end());
    if (each.size() != model.effects.size() || model.effects.size() > 3 ||
        !std::is_sorted(model.effects.begin(), model.effects.end()) ||
        (!each.empty() && (*each.begin() < 0 || *each.rbegin() >= k || model.none_of_these)))
      return absl::InvalidArgumentError("a model's effects are not ascending, known and at most 3");
  }
  for (const double share :
       {shares.adequate, shares.singles, shares.pairs, shares.triples, shares.none_of_these}) {
    if (!(share >= 0) || !std::isfinite(share))
      return absl::InvalidArgumentError("a prior share is negative");
  }
  return absl::OkStatus();
}

Eigen::VectorXd ModelSpace::LogPrior() const {
  if (log_prior.size() > 0) return log_prior;
  const std::array<double, 5> share = {shares.adequate, shares.singles, shares.pairs,
                                       shares.triples, shares.none_of_these};
  std::array<int, 5> number{};
  for (const EffectModel& model : models) ++number[ShareOf(model)];
  number[3] = number[3] > 0 ? std::max(number[3], triples) : 0;
  double total = 0;
  for (std::size_t s = 0; s < share.size(); ++s) total += number[s] > 0 ? share[s] : 0;
  Eigen::VectorXd result(static_cast<Index>(models.size()));
  for (std::size_t i = 0; i < models.size(); ++i) {
    const std::size_t s = ShareOf(models[i]);
    result[static_cast<Index>(i)] = std::log(share[s] / total / number[s]);
  }
  return result;
}

std::vector<EffectModel> AllModels(int effects, const std::vector<std::pair<int, int>>& excluded) {
  std::set<std::pair<int, int>> apart;
  for (const auto& [a, b] : excluded) apart.insert(std::minmax(a, b));
  std::vector<EffectModel> result = {{}};
  for (int k = 0; k < effects; ++k) result.push_back({.effects = {k}});
  for (int k = 0; k < effects; ++k) {
    for (int l = k + 1; l < effects; ++l) {
      if (apart.count({k, l}) == 0) result.push_back({.effects = {k, l}});
    }
  }
  result.push_back({.none_of_these = true});
  return result;
}

std::vector<EffectModel> TriplesOf(int effects, const std::vector<std::pair<int, int>>& excluded,
                                   const std::vector<EffectModel>& pairs) {
  std::set<std::pair<int, int>> apart;
  for (const auto& [a, b] : excluded) apart.insert(std::minmax(a, b));
  std::vector<EffectModel> result;
  for (const EffectModel& pair : pairs) {
    for (int k = 0; k < effects; ++k) {
      const auto goes = [&apart, k](int e) {
        return e != k && apart.count(std::minmax(e, k)) == 0;
      };
      if (!std::all_of(pair.effects.begin(), pair.effects.end(), goes)) continue;
      EffectModel triple = pair;
      triple.effects.insert(std::upper_bound(triple.effects.begin(), triple.effects.end(), k), k);
      if (std::find(result.begin(), result.end(), triple) == result.end())
        result.push_back(std::move(triple));
    }
  }
  return result;
}

int CountTriples(int effects, const std::vector<std::pair<int, int>>& excluded) {
  std::vector<EffectModel> pairs;
  for (EffectModel& model : AllModels(effects, excluded)) {
    if (model.effects.size() == 2) pairs.push_back(std::move(model));
  }
  return static_cast<int>(TriplesOf(effects, excluded, pairs).size());
}

ModelCube::ModelCube(const ModelSpace& space, const EffectModel& model, std::vector<int> sign)
    : space_(space), model_(model), sign_(std::move(sign)) {
  dimensions_ = space.base_low.size() + static_cast<Index>(model.effects.size()) +
                (model.none_of_these ? 1 : 0);
  for (const int k : model.effects)
    dimensions_ += space.effects[static_cast<std::size_t>(k)].shapes;
}

DesignPoints ModelCube::Points(const Eigen::MatrixXd& cube) const {
  const Index m = cube.rows(), d = space_.base_low.size();
  const auto k = static_cast<int>(space_.effects.size());
  DesignPoints points{.base = Eigen::MatrixXd(m, d),
                      .strength = Eigen::MatrixXd::Zero(m, k),
                      .shape = Eigen::MatrixXd::Zero(m, ShapesBefore(space_, k))};
  for (Index j = 0; j < d; ++j) {
    points.base.col(j) =
        space_.base_low[j] + (space_.base_high[j] - space_.base_low[j]) * cube.col(j).array();
  }
  Index column = d;
  for (std::size_t e = 0; e < model_.effects.size(); ++e, ++column) {
    const int effect = model_.effects[e];
    const StrengthPrior& prior = space_.strength[static_cast<std::size_t>(effect)];
    const double low = sign_[e] > 0 ? prior.low : prior.negative_low;
    const double high = sign_[e] > 0 ? prior.high : prior.negative_high;
    points.strength.col(effect) =
        sign_[e] * low * (cube.col(column).array() * std::log(high / low)).exp();
  }
  for (const int effect : model_.effects) {
    const Index first = ShapesBefore(space_, effect);
    for (int h = 0; h < space_.effects[static_cast<std::size_t>(effect)].shapes; ++h, ++column) {
      points.shape.col(first + h) =
          space_.shape_low[first + h] +
          (space_.shape_high[first + h] - space_.shape_low[first + h]) * cube.col(column).array();
    }
  }
  return points;
}

Eigen::VectorXd ModelCube::Tau(const Eigen::MatrixXd& cube) const {
  return space_.tau_low *
         (cube.col(dimensions_ - 1).array() * std::log(space_.tau_high / space_.tau_low)).exp();
}

Eigen::VectorXd ModelCube::LogPrior(const DesignPoints& points) const {
  if (!space_.log_base_prior) return Eigen::VectorXd::Zero(points.rows());
  return space_.log_base_prior(points.base);
}

std::vector<std::vector<int>> SignsOf(const ModelSpace& space, const EffectModel& model) {
  std::vector<std::vector<int>> result = {{}};
  for (const int effect : model.effects) {
    std::vector<std::vector<int>> longer;
    for (const std::vector<int>& signs : result) {
      for (const int sign : {1, -1}) {
        if (sign < 0 && !space.effects[static_cast<std::size_t>(effect)].two_sided) continue;
        longer.push_back(signs);
        longer.back().push_back(sign);
      }
    }
    result = std::move(longer);
  }
  return result;
}

}  // namespace calib::inference
