// Work of a contact in a closed cycle of its motion: shear, unloading, shear back, reloading.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "dem/dynamics/contact_model.h"
#include "dem/registry/catalog.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kGrain = 1e-3;    // radius [m]
constexpr double kOverlap = 2e-6;  // [m]
constexpr double kShear = 1e-7;    // [m], little enough not to slide
constexpr int kSteps = 2000;       // of each leg of the cycle

/// What a contact of two equal grains does while j is moved; a leg at a time.
class Cycle {
 public:
  explicit Cycle(const Model& model)
      : model_(ContactModelOf(model)), unloading_(model.shear_unloading) {
    block_.count = 1;
    block_.dt = 1e-6;
    block_.sliding_friction = model_.sliding_friction();
    block_.dy[0] = block_.dz[0] = 0;
    block_.radius_i[0] = block_.radius_j[0] = kGrain;
    for (ContactBlock::Lane* lane : {&block_.vx, &block_.vy, &block_.vz, &block_.wix, &block_.wiy,
                                     &block_.wiz, &block_.wjx, &block_.wjy, &block_.wjz}) {
      (*lane)[0] = 0;
    }
    for (auto& column : block_.own_history) column[0] = 0;
    Move(kOverlap, 0);
    work_ = given_ = 0;
  }

  void Leg(double to, double shear) {
    const double from = overlap_;
    for (int k = 1; k <= kSteps; ++k) Move(from + (to - from) * k / kSteps, shear / kSteps);
  }

  [[nodiscard]] double work() const { return work_; }  ///< of the contact on the grains [J]
  /// What the shear law adds to its spring as ks changes, all steps [J]: F^2/2 (1/k - 1/k before),
  /// rescaled: F^2/2 (k/k_before^2 - 1/k before) where ks falls.
  [[nodiscard]] double given() const { return given_; }
  [[nodiscard]] double stiffness() const { return block_.tangential_stiffness[0]; }
  [[nodiscard]] double stored() const { return 0.5 * Spring() * Spring() / stiffness(); }

 private:
  [[nodiscard]] double Spring() const { return block_.history[model_.shear_history() + 1][0]; }

  void Move(double overlap, double shear) {
    const double normal = block_.normal_force[0];
    const double across = block_.fy[0];
    const double spring = Spring();
    const double before = stiffness();
    block_.dx[0] = 2 * kGrain - overlap;
    block_.vy[0] = shear * (2 * kGrain - overlap) / (2 * kGrain) / block_.dt;  // slip of `shear`
    PadLanes(kMaxHistory, block_);
    model_.Evaluate(block_);
    work_ += 0.5 * (normal + block_.normal_force[0]) * (overlap_ - overlap);
    work_ += 0.5 * (across + block_.fy[0]) * block_.slip_y[0];
    const double after = stiffness();
    const bool along = unloading_ == ShearUnloading::kRescaled && after < before;
    given_ += 0.5 * spring * spring * (along ? after / (before * before) : 1 / after);
    given_ -= 0.5 * spring * spring / before;
    overlap_ = overlap;
  }

  ContactModel model_;
  ShearUnloading unloading_;
  ContactBlock block_{};
  double overlap_ = kOverlap;
  double work_ = 0, given_ = 0;
};

Cycle Around(const Model& model) {
  Cycle cycle(model);
  cycle.Leg(kOverlap, kShear);
  cycle.Leg(0.5 * kOverlap, 0);
  cycle.Leg(0.5 * kOverlap, -kShear);
  cycle.Leg(kOverlap, 0);
  return cycle;
}

// ks goes with sqrt(u) and the force stays at unloading: of ks d^2/2 the share 1 - sqrt(1/2) comes
// out without being paid, and a spring is left that holds (1 - sqrt(1/2))^2 of it besides.
TEST(ContactCycles, ShearOfHertzMindlinGivesWorkAtUnloading) {
  Model model = test::HertzModel();
  model.parameters["friction_coefficient"] = 10;
  const Cycle cycle = Around(model);
  const double sheared = 0.5 * cycle.stiffness() * kShear * kShear;
  const double share = 1 - std::sqrt(0.5);
  EXPECT_NEAR(cycle.work() / sheared, share, 1e-3);
  EXPECT_NEAR(cycle.stored() / sheared, share * share, 1e-3);
}

TEST(ContactCycles, ConstantShearStiffnessGivesNothing) {
  Model model = test::LinearModel();
  model.parameters["friction_coefficient"] = 10;
  const Cycle cycle = Around(model);
  EXPECT_NEAR(cycle.work(), 0, 1e-9 * 0.5 * cycle.stiffness() * kShear * kShear);
}

// The rescaled force is ks d throughout shear, unloading and shear back: nothing is left, and
// (k_1 - k_2) d^2/2 of what the shear put in is lost. The other way round, unloading first, it is
// (k_1 - k_2) k_2/k_1 d^2/2, what stays in the spring counted as kept.
TEST(ContactCycles, RescaledShearGivesNothing) {
  Model model = test::HertzModel();
  model.parameters["friction_coefficient"] = 10;
  model.shear_unloading = ShearUnloading::kRescaled;
  const double ratio = std::sqrt(0.5);  // k_2/k_1
  const Cycle cycle = Around(model);
  const double sheared = 0.5 * cycle.stiffness() * kShear * kShear;
  EXPECT_NEAR(cycle.work() / sheared, -(1 - ratio), 1e-3);
  EXPECT_NEAR(cycle.stored() / sheared, 0, 1e-9);
  Cycle other(model);
  other.Leg(0.5 * kOverlap, 0);
  other.Leg(0.5 * kOverlap, kShear);
  other.Leg(kOverlap, 0);
  other.Leg(kOverlap, -kShear);
  EXPECT_NEAR((other.work() + other.stored()) / sheared, -(1 - ratio) * ratio, 1e-3);
}

// Any closed path of overlap and shear, sliding included: what comes out and what is left is at
// most nothing where the force is rescaled; of the same paths as published some give work.
TEST(ContactCycles, NoPathOfRescaledShearGivesWork) {
  int give = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    const auto share = [&random] { return static_cast<double>(random()) / 4294967296.0; };
    Model model = test::HertzModel();
    model.parameters["friction_coefficient"] = seed % 2 == 0 ? 10 : 0.1;
    Cycle published(model);
    model.shear_unloading = ShearUnloading::kRescaled;
    Cycle rescaled(model);
    double moved = 0;
    for (int leg = 0; leg < 6; ++leg) {
      const bool last = leg == 5;
      const double to = last ? kOverlap : (0.1 + 0.9 * share()) * kOverlap;
      const double by = last ? -moved : (share() - 0.5) * 2 * kShear;
      moved += by;
      published.Leg(to, by);
      rescaled.Leg(to, by);
    }
    const double sheared = 0.5 * published.stiffness() * kShear * kShear;
    EXPECT_LT(rescaled.work() + rescaled.stored(), 1e-3 * sheared) << seed;
    give += published.work() + published.stored() > 1e-2 * sheared ? 1 : 0;
  }
  EXPECT_GT(give, 3);
}

// Every contact effect that acts at a kept contact: what comes out and what is left is at most what
// the shear law gives, and exactly that where nothing takes energy.
TEST(ContactCycles, EffectsGiveNoMoreThanTheShearLawDoes) {
  struct Case {
    std::string effect;
    std::map<std::string, double> values;
    bool takes = false;  // energy, by hysteresis or dashpots
  };
  const std::vector<Case> cases = {
      {"hertz_nonlinearity", {{"exponent", 2.2}, {"reference_pressure", 2e5}}},
      {"hertz_nonlinearity", {{"exponent", 0.8}, {"reference_pressure", 2e5}}},
      {"contact_plasticity", {{"stiffness_ratio", 1.2}}, true},
      {"adhesion_dmt", {{"work_of_adhesion", 0.1}}},
      {"adhesion_jkr", {{"work_of_adhesion", 0.1}}},
      {"linear_cohesion", {{"energy_density", 1e3}}},
      {"pressure_dependent_friction", {{"exponent", 0.1}, {"reference_pressure", 2e5}}},
      {"capillary_bridges", {{"surface_tension", 0.07}, {"volume_ratio", 1e-3}}},
      {"viscous_damping", {{"ratio", 0.1}}, true},
      {"rolling_resistance", {{"stiffness_ratio", 0.5}, {"friction", 0.5}}},
      {"twisting_resistance", {{"stiffness_ratio", 0.5}, {"friction", 0.5}}}};
  for (const Model& base : {test::HertzModel(), test::LinearModel()}) {
    for (const Case& c : cases) {
      if (c.effect == "adhesion_jkr" && base.contact != "hertz_mindlin") continue;
      for (const auto unloading : {ShearUnloading::kAsPublished, ShearUnloading::kRescaled}) {
        Scenario s;
        s.model = base;
        s.model.parameters["friction_coefficient"] = 10;
        s.model.shear_unloading = unloading;
        const Cycle cycle = Around(test::With(s, c.effect, c.values).model);
        const double sheared = 0.5 * cycle.stiffness() * kShear * kShear;
        const double balance = cycle.work() + cycle.stored() - cycle.given();
        EXPECT_LT(balance, 1e-3 * sheared) << base.contact << " " << c.effect;
        if (!c.takes) {
          EXPECT_GT(balance, -1e-3 * sheared) << base.contact << " " << c.effect;
        }
        if (unloading == ShearUnloading::kRescaled) {
          EXPECT_LT(cycle.work() + cycle.stored(), 1e-3 * sheared)
              << base.contact << " " << c.effect;
        }
      }
    }
  }
}

}  // namespace
}  // namespace calib::dem
