#include "server/diagnosis/refit_order.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dem/registry/catalog.h"
#include "dem/registry/declared_effects.h"

namespace calib::diagnosis {
namespace {

constexpr std::size_t kFirst = 4;  // two batches each pick those to continue
constexpr double kPatience = 1.5;  // a batch more must bring a fit this much closer
constexpr int kEnough = 3;         // effects that explain the readings: more are not named

double Promised(const RefitOrder& order, const std::string& effect) {
  const auto share = order.promised.find(effect);
  return share == order.promised.end() ? 1 : share->second;
}

// No two of them alike.
int CountExplaining(const RefitOrder& order, const std::vector<RefitStanding>& begun) {
  std::set<std::string> stood_for;
  int count = 0;
  for (const RefitStanding& refit : begun) {
    if (!refit.explains) continue;
    if (stood_for.count(refit.effect) == 0) ++count;
    const auto alike = order.alike.find(refit.effect);
    if (alike != order.alike.end()) stood_for.insert(alike->second.begin(), alike->second.end());
  }
  return count;
}

}  // namespace

RefitOrder OrderOfRefits(const Diagnosis& diagnosis, const std::vector<dem::UserEffect>& user,
                         double level) {
  RefitOrder order;
  for (const CandidateEffect& a : diagnosis.candidates) {
    order.promised[a.effect] = a.predicted_rms_error / diagnosis.rms;
    order.alike[a.effect].insert(a.confusable_with.begin(), a.confusable_with.end());
    for (const CandidateEffect& b : diagnosis.candidates) {
      if (dem::Exclude(*dem::FindEffect(user, a.effect), *dem::FindEffect(user, b.effect))) {
        order.alike[a.effect].insert(b.effect);
      }
    }
  }
  std::vector<const CandidateEffect*> others;
  std::set<std::string> stood_for;
  for (const CandidateEffect& candidate : diagnosis.candidates) {
    if (order.first.size() < kFirst && stood_for.count(candidate.effect) == 0) {
      order.first.push_back(candidate.effect);
      const std::set<std::string>& alike = order.alike[candidate.effect];
      stood_for.insert(alike.begin(), alike.end());
    } else {
      others.push_back(&candidate);
    }
  }
  std::stable_sort(others.begin(), others.end(), [&stood_for](const auto* a, const auto* b) {
    const auto a_has = stood_for.count(a->effect);
    const auto b_has = stood_for.count(b->effect);
    return a_has != b_has ? a_has < b_has : a->explained_fraction > b->explained_fraction;
  });
  const bool missing = diagnosis.adequacy.p_value < level;
  for (const CandidateEffect* other : others) {
    const bool hinted = other->p_value < level;
    if (hinted || (missing && other->explained_fraction > 0)) {
      order.later.push_back({.effect = other->effect, .hinted = hinted});
    }
  }
  return order;
}

// Without the effect it is the base model: a fit that is further off has merely not been found. One
// that is not as close as the screen expects has further to go.
double PriceOf(double chi2, double base, double promised, double batches) {
  const double share = std::min(1.0, promised);
  return std::sqrt(std::min(chi2, base * share * share)) * std::pow(kPatience, batches);
}

std::optional<std::string> NextRefit(const RefitOrder& order,
                                     const std::vector<RefitStanding>& begun, double base_chi2,
                                     bool may_begin) {
  const RefitStanding* open = nullptr;
  const RefitStanding* explaining = nullptr;
  const auto price = [&](const RefitStanding& refit) {
    return PriceOf(refit.chi2, base_chi2, Promised(order, refit.effect), refit.batches);
  };
  const auto closest = std::min_element(
      begun.begin(), begun.end(), [](const auto& a, const auto& b) { return a.chi2 < b.chi2; });
  const auto price_of_known = [&](const RefitStanding& refit) {
    return &refit == &*closest ? std::numeric_limits<double>::infinity() : price(refit);
  };
  for (const RefitStanding& refit : begun) {
    if (refit.stalled) continue;
    if (refit.explains) {
      if (explaining == nullptr || price_of_known(refit) < price_of_known(*explaining)) {
        explaining = &refit;
      }
    } else if (open == nullptr || price(refit) < price(*open)) {
      open = &refit;
    }
  }
  const auto is_begun = [&begun](const RefitOrder::Later& later) {
    return std::any_of(begun.begin(), begun.end(),
                       [&later](const auto& r) { return r.effect == later.effect; });
  };
  const auto is_like_one_that_explains = [&](const RefitOrder::Later& later) {
    const auto alike = order.alike.find(later.effect);
    return alike != order.alike.end() &&
           std::any_of(begun.begin(), begun.end(), [&alike](const auto& r) {
             return r.explains && alike->second.count(r.effect) > 0;
           });
  };
  if (may_begin) {
    for (const RefitOrder::Later& later : order.later) {
      if (!is_begun(later) && is_like_one_that_explains(later)) return later.effect;
    }
    const bool enough = CountExplaining(order, begun) >= kEnough;
    for (const RefitOrder::Later& later : order.later) {
      if (is_begun(later) || (enough && !later.hinted)) continue;
      if (open == nullptr || PriceOf(base_chi2, base_chi2, Promised(order, later.effect),
                                     kLeastBatches) < price(*open)) {
        return later.effect;
      }
      break;
    }
  }
  if (open != nullptr) return open->effect;
  if (explaining != nullptr) return explaining->effect;
  return std::nullopt;
}

}  // namespace calib::diagnosis
