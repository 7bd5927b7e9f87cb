// Effects of kind "contact" against their closed forms, and their nulls against the model without.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "dem/dynamics/assembly.h"
#include "dem/elementary/power.h"
#include "dem/registry/catalog.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kRadiusI = 2e-3;
constexpr double kRadiusJ = 3e-3;
constexpr double kEffective = kRadiusI * kRadiusJ / (kRadiusI + kRadiusJ);

Model With(Model model, const std::string& effect, const std::map<std::string, double>& values) {
  model.effects.push_back(effect);
  for (const auto& [name, value] : values) {
    model.parameters[effect + "." + name] = value;
  }
  return model;
}

/// One pair along x, kept from call to call.
class Pair {
 public:
  explicit Pair(const Model& m) : model_(ContactModelOf(m)) {
    block_.count = kBlock;
    block_.dt = 1e-6;
    block_.sliding_friction = model_.sliding_friction();
    for (int k = 0; k < kBlock; ++k) {
      block_.radius_i[k] = kRadiusI;
      block_.radius_j[k] = kRadiusJ;
    }
  }

  /// Normal force at an overlap, with a velocity of j along and across the normal.
  double Force(double overlap, double vx = 0, double vy = 0) {
    for (int k = 0; k < kBlock; ++k) {
      block_.dx[k] = kRadiusI + kRadiusJ - overlap;
      block_.vx[k] = vx;
      block_.vy[k] = vy;
    }
    model_.Evaluate(block_);
    return block_.normal_force[0];
  }

  [[nodiscard]] const ContactBlock& block() const { return block_; }

 private:
  ContactModel model_;
  ContactBlock block_{};
};

TEST(Power, AgreesWithLibmToFourteenDigits) {
  double worst = 0;
  for (double x = 1e-30; x < 1e20; x *= 1.7) {
    for (const double y : {-2.5, -1.0 / 3.0, 0.0, 0.1, 0.4, 1.0 / 3.0, 1.0, 3.0}) {
      worst = std::max(worst, std::abs(Power(x, y) / std::pow(x, y) - 1));
    }
    EXPECT_EQ(Power(x, 0.0), 1.0);
  }
  EXPECT_LT(worst, 5e-14);
}

TEST(HertzNonlinearity, ForceIsThatOfTheLawAtTheReferenceAndAPowerElsewhere) {
  constexpr double kPressure = 2e5;
  const double reference = kPressure * 16 * kEffective * kEffective;
  struct Case {
    Model base;
    double exponent_of_base, coefficient;
  };
  const double hertz = 2 * 8e8 / (3 * (1 - 0.04)) * std::sqrt(kEffective);
  for (const Case& c : {Case{test::LinearModel(), 1.0, 2 * 1.2e8 * kEffective},
                        Case{test::HertzModel(), 1.5, hertz}}) {
    const double u_ref = std::pow(reference / c.coefficient, 1 / c.exponent_of_base);
    for (const double n : {1.1, 1.5, 2.2}) {
      Pair pair(
          With(c.base, "hertz_nonlinearity", {{"exponent", n}, {"reference_pressure", kPressure}}));
      for (const double u : {0.2 * u_ref, u_ref, 3 * u_ref}) {
        const double expected = reference * std::pow(u / u_ref, n);
        EXPECT_NEAR(pair.Force(u), expected, 1e-9 * expected);
        EXPECT_NEAR(pair.block().normal_stiffness[0], n * expected / u, 1e-9 * n * expected / u);
        // Tangential over normal stiffness stays that of the law.
        Pair plain(c.base);
        plain.Force(u);
        const double ratio =
            plain.block().tangential_stiffness[0] / plain.block().normal_stiffness[0];
        EXPECT_NEAR(pair.block().tangential_stiffness[0], ratio * pair.block().normal_stiffness[0],
                    1e-9 * n * expected / u);
      }
    }
  }
}

TEST(ContactPlasticity, LinearLoopUnloadsAlongTheStifferSpring) {
  constexpr double kRatio = 3;
  Pair pair(With(test::LinearModel(), "contact_plasticity", {{"stiffness_ratio", kRatio}}));
  const double k1 = 2 * 1.2e8 * kEffective;
  const double most = 1e-5;
  EXPECT_NEAR(pair.Force(most), k1 * most, 1e-9 * k1 * most);
  const double rest = (1 - 1 / kRatio) * most;
  for (const double u : {0.95 * most, 0.8 * most, 0.7 * most}) {
    EXPECT_NEAR(pair.Force(u), kRatio * k1 * (u - rest), 1e-9 * k1 * most);
    EXPECT_NEAR(pair.block().normal_stiffness[0], kRatio * k1, 1e-9 * k1);
  }
  EXPECT_EQ(pair.Force(0.6 * most), 0);
  EXPECT_NEAR(pair.Force(0.9 * most), kRatio * k1 * (0.9 * most - rest), 1e-9 * k1 * most);
  EXPECT_NEAR(pair.Force(1.2 * most), k1 * 1.2 * most, 1e-9 * k1 * most);
}

/// Two equal spheres meeting head on at `speed` each: speed of parting over speed of closing.
double Restitution(const Model& model, double speed, double dt) {
  constexpr double kRadius = 1e-2;
  const double n[3] = {1, 0, 0};
  Assembly assembly(test::TwoSpheres(kRadius, 2.00001 * kRadius, n), model.density,
                    ContactModelOf(model), 1);
  ParticleArrays& p = assembly.mutable_particles();
  for (std::size_t g = 0; g < 2; ++g) {
    p.vx[g] = p.id[g] == 0 ? speed : -speed;
  }
  EXPECT_TRUE(assembly.EvaluateForces().ok());
  bool touched = false;
  for (int step = 0; step < 2'000'000; ++step) {
    assembly.Move({.dt = dt});
    EXPECT_TRUE(assembly.EvaluateForces().ok());
    if (touched && assembly.contacts() == 0) {
      break;
    }
    touched = touched || assembly.contacts() > 0;
  }
  EXPECT_TRUE(touched);
  return 0.5 * std::abs(p.vx[0] - p.vx[1]) / speed;
}

Model Real(Model model) {
  model.density = 2650;
  return model;
}

/// About a contact time of linear contacts in Restitution(), over 4000.
double SmallStep() {
  const double mass = 2650 * 4.0 / 3.0 * kPi * 1e-6 / 2;
  return kPi * std::sqrt(mass / (1.2e8 * 1e-2)) / 4000;
}

TEST(ContactPlasticity, RestitutionFollowsTheRatioOfStiffnesses) {
  for (const double ratio : {1.5, 4.0}) {
    const auto model =
        With(Real(test::LinearModel()), "contact_plasticity", {{"stiffness_ratio", ratio}});
    EXPECT_NEAR(Restitution(model, 0.5, SmallStep()), 1 / std::sqrt(ratio), 2e-3);
  }
  // Hertz: e^2 = 5/2 [ratio 2/5 (1 - x^{5/2}) - (ratio - 1)(1 - x)], x^{3/2} = 1 - 1/ratio
  const double x = std::pow(1 - 1 / 3.0, 2.0 / 3.0);
  const double e2 = 2.5 * (3 * 0.4 * (1 - std::pow(x, 2.5)) - 2 * (1 - x));
  const auto model = With(Real(test::HertzModel()), "contact_plasticity", {{"stiffness_ratio", 3}});
  EXPECT_NEAR(Restitution(model, 0.5, SmallStep()), std::sqrt(e2), 2e-3);
}

TEST(ViscousDamping, RestitutionOfLinearContactsWithoutTension) {
  for (const double beta : {0.05, 0.3, 0.6}) {
    const double root = std::sqrt(1 - beta * beta);
    const double turn = std::atan2(2 * beta * root, 2 * beta * beta - 1);
    const double expected = std::exp(-beta / root * (kPi - (kPi - turn)));
    // time until force, not overlap, is zero: phase = pi - arctan(2 beta root/(2 beta^2 - 1))
    const double phase = std::atan2(2 * beta * root, -(2 * beta * beta - 1));
    const double closed =
        std::exp(-beta / root * (beta < std::numbers::sqrt2 / 2 ? kPi - phase : -phase));
    EXPECT_NEAR(expected, closed, 1e-12);
    const auto model = With(Real(test::LinearModel()), "viscous_damping", {{"ratio", beta}});
    EXPECT_NEAR(Restitution(model, 0.5, SmallStep()), closed, 2e-3 * closed) << beta;
  }
}

TEST(ViscousDamping, RestitutionOfHertzContactsDoesNotDependOnSpeed) {
  const auto model = With(Real(test::HertzModel()), "viscous_damping", {{"ratio", 0.2}});
  const double slow = Restitution(model, 0.05, SmallStep());
  const double fast = Restitution(model, 2, SmallStep());
  EXPECT_NEAR(slow, fast, 2e-3);
  EXPECT_LT(slow, 0.75);
}

TEST(ViscousDamping, NeitherPullsNorExceedsTheSlidingLimit) {
  Pair pair(With(test::LinearModel(), "viscous_damping", {{"ratio", 5}}));
  EXPECT_EQ(pair.Force(1e-6, 1e3), 0);
  Pair shear(With(test::LinearModel(), "viscous_damping", {{"ratio", 5}}));
  const double force = shear.Force(1e-5, 0, 0.1);
  EXPECT_GT(std::abs(shear.block().fy[0]), 0.49 * force);
  EXPECT_LE(std::abs(shear.block().fy[0]), 0.5 * force * (1 + 1e-12));
}

TEST(LinearCohesion, PullsWithTheAreaOfContact) {
  constexpr double kDensity = 1e6;
  Pair plain(test::LinearModel());
  Pair pair(With(test::LinearModel(), "linear_cohesion", {{"energy_density", kDensity}}));
  for (const double u : {1e-6, 1e-5}) {
    const double pull = kDensity * 2 * kPi * kEffective * u;
    const double expected = plain.Force(u) - pull;
    EXPECT_NEAR(pair.Force(u), expected, 1e-12 * plain.Force(u));
    EXPECT_NEAR(pair.block().sliding_limit[0], 0.5 * plain.Force(u), 1e-12 * plain.Force(u));
  }
}

TEST(AdhesionDmt, PullOffIsTwoPiWR) {
  constexpr double kWork = 0.5;
  Pair plain(test::HertzModel());
  Pair pair(With(test::HertzModel(), "adhesion_dmt", {{"work_of_adhesion", kWork}}));
  const double pull_off = 2 * kPi * kWork * kEffective;
  EXPECT_NEAR(pair.Force(1e-12), -pull_off, 1e-6 * pull_off);
  EXPECT_NEAR(pair.Force(1e-5), plain.Force(1e-5) - pull_off, 1e-12);
  EXPECT_NEAR(pair.block().sliding_limit[0], 0.55 * plain.Force(1e-5), 1e-12);
}

constexpr double kWork = 2.0;

Model Sticky() { return With(test::HertzModel(), "adhesion_jkr", {{"work_of_adhesion", kWork}}); }

TEST(AdhesionJkr, ForceAndOverlapFollowTheContactRadius) {
  const double modulus = 8e8 / (2 * (1 - 0.04));
  const double smallest = std::cbrt(kPi * kWork * kEffective * kEffective / (8 * modulus));
  Pair pair(Sticky());
  const double unit = kPi * kWork * kEffective;
  for (const double z : {1.02, 1.3, 1.6, 2.5, 5.0}) {
    const double a = smallest * z * z;
    const double u = a * a / kEffective - std::sqrt(2 * kPi * kWork * a / modulus);
    const double force = 4 * modulus * a * a * a / (3 * kEffective) -
                         std::sqrt(8 * kPi * kWork * modulus * a * a * a);
    EXPECT_NEAR(pair.Force(u), force, 1e-9 * std::max(unit, std::abs(force))) << z;
  }
  EXPECT_NEAR(pair.Force(0), -4.0 / 3.0 * unit, 1e-9 * unit);
  double least = 0;
  const double width = smallest * smallest / kEffective;
  for (double u = -3 * width; u < width; u += 1e-4 * width) {
    least = std::min(least, pair.Force(u));
  }
  EXPECT_NEAR(least, -1.5 * unit, 1e-6 * unit);
  EXPECT_NEAR(pair.block().attraction[0], 1.5 * unit, 1e-12);
}

/// Largest gap at which two spheres of radius r, once touching, still pull on each other, when they
/// are drawn apart in steps; `forming` is set to the overlap at which they began to.
double BreakingGap(const Model& model, double r, double step, double& forming) {
  const double n[3] = {1, 0, 0};
  Assembly assembly(test::TwoSpheres(r, 2 * r + 5 * step, n), 2650, ContactModelOf(model), 1);
  ParticleArrays& p = assembly.mutable_particles();
  const auto right = static_cast<std::size_t>(p.x[0] > p.x[1] ? 0 : 1);
  const auto gap = [&] { return std::abs(p.x[1] - p.x[0]) - 2 * r; };
  const auto pulls = [&] {
    EXPECT_TRUE(assembly.EvaluateForces().ok());
    const auto& neighbors = assembly.neighbors();
    return neighbors.size() > 0 && assembly.touching(0) && assembly.force_on_j(0).x != 0;
  };
  while (!pulls()) {
    p.x[right] -= step;
  }
  forming = -gap();
  double last = 0;
  while (pulls()) {
    last = gap();
    p.x[right] += step;
  }
  return last;
}

TEST(AdhesionJkr, FormsOnTouchingAndBreaksAtItsGap) {
  constexpr double kRadius = 1e-3;
  const double modulus = 8e8 / (2 * (1 - 0.04));
  const double effective = kRadius / 2;
  const double smallest = std::cbrt(kPi * kWork * effective * effective / (8 * modulus));
  const double expected = 3 * smallest * smallest / effective;
  const double step = 1e-3 * expected;
  double forming = 0;
  EXPECT_NEAR(BreakingGap(Sticky(), kRadius, step, forming), expected, 2 * step);
  EXPECT_GT(forming, 0);
  EXPECT_LE(forming, 1.01 * step);
}

TEST(CapillaryBridges, FollowTheClosedFormAndRupture) {
  constexpr double kTension = 0.073;
  constexpr double kAngle = 0.3;
  constexpr double kVolume = 1e-12;
  const Model model =
      With(test::HertzModel(), "capillary_bridges",
           {{"surface_tension", kTension}, {"liquid_volume", kVolume}, {"contact_angle", kAngle}});
  Pair pair(model);
  Pair plain(test::HertzModel());
  const double radius = 2 * kEffective;
  const double rupture = (1 + kAngle / 2) * std::cbrt(kVolume);
  for (const double s : {0.0, 0.2 * rupture, 0.9 * rupture}) {
    const double scaled = s * std::sqrt(radius / kVolume);
    const double force = 2 * kPi * radius * kTension * std::cos(kAngle) /
                         (1 + 1.05 * scaled + 2.5 * scaled * scaled);
    EXPECT_NEAR(pair.Force(-s), -force, 1e-9 * force);
  }
  EXPECT_EQ(pair.Force(-1.001 * rupture), 0);
  const double at_touch = 2 * kPi * radius * kTension * std::cos(kAngle);
  EXPECT_NEAR(pair.Force(1e-5), plain.Force(1e-5) - at_touch, 1e-9 * at_touch);
  EXPECT_NEAR(pair.block().sliding_limit[0], 0.55 * plain.Force(1e-5), 1e-12);
  double forming = 0;
  const double step = 1e-3 * rupture;
  EXPECT_NEAR(BreakingGap(model, 1e-3, step, forming), rupture, 2 * step);
  EXPECT_GT(forming, 0);
}

TEST(PressureDependentFriction, LimitFollowsTheNominalPressureOfTheContact) {
  constexpr double kExponent = 0.3;
  Pair pair(With(test::LinearModel(), "pressure_dependent_friction",
                 {{"exponent", kExponent}, {"reference_pressure", 3e5}}));
  for (const double u : {1e-6, 1e-5}) {
    const double force = pair.Force(u);
    const double ratio = force / (16 * kEffective * kEffective) / 3e5;
    const double limit = 0.5 * std::pow(ratio, -kExponent) * force;
    EXPECT_NEAR(pair.block().sliding_limit[0], limit, 1e-9 * limit);
  }
}

TEST(Effects, AtTheirNullTheModelIsTheSimplerOneBitForBit) {
  const ReferenceState state{.pressure = 2e5, .diameter = 2e-3, .modulus = 8e8};
  for (const Model& base : {test::HertzModel(), test::LinearModel()}) {
    const test::Run plain = test::RunAll(test::SmallTriaxial(base));
    for (const EffectInfo& effect : Effects()) {
      if (!effect.contacts.empty() &&
          std::count(effect.contacts.begin(), effect.contacts.end(), base.contact) == 0) {
        continue;
      }
      for (const StrengthRay& ray : effect.rays) {
        Model model = base;
        model.effects = {effect.name};
        model.parameters.merge(ParametersOnRay(effect, ray, 0, base.contact, state));
        const test::Run run = test::RunAll(test::SmallTriaxial(model));
        ASSERT_EQ(run.states.size(), plain.states.size()) << effect.name << run.summary.reason;
        for (std::size_t s = 0; s < run.states.size(); ++s) {
          EXPECT_EQ(run.states[s].values, plain.states[s].values) << effect.name << " " << s;
        }
      }
    }
  }
}

TEST(Effects, AModerateStrengthRunsAndShows) {
  const ReferenceState state{.pressure = 2e5, .diameter = 2e-3, .modulus = 8e8};
  Model base = test::HertzModel();
  base.density = 2650;
  Scenario triaxial = test::SmallTriaxial(base);
  triaxial.packing = test::SmallPacking(150);  // fewer jump from porosity to porosity
  triaxial.path.push_back({.target = 0.05, .load_step = 3});  // far enough for a grain to break
  const test::Run plain = test::RunAll(triaxial);
  for (const EffectInfo& effect : Effects()) {
    const std::vector<std::string>& tests = effect.excited_by;
    if (!tests.empty() && std::find(tests.begin(), tests.end(), triaxial.test) == tests.end()) {
      continue;  // walls_test.cc and gravity_tests_test.cc
    }
    for (const StrengthRay& ray : effect.rays) {
      for (const double step : {ray.steps[0], ray.steps[1], -ray.steps[1]}) {
        if (!RayAdmits(effect, ray, step, base.contact, state)) {
          continue;
        }
        Scenario scenario = triaxial;
        scenario.model.effects = {effect.name};
        scenario.model.parameters.merge(ParametersOnRay(effect, ray, step, base.contact, state));
        const test::Run run = test::RunAll(scenario);
        if (effect.name == "initial_density" && step < 0) {
          EXPECT_EQ(run.summary.outcome, Outcome::kDiverged) << "nothing was lowered to begin with";
          continue;
        }
        ASSERT_EQ(run.summary.outcome, Outcome::kCompleted)
            << effect.name << " " << step << ": " << run.summary.reason;
        EXPECT_NE(run.states.back().values, plain.states.back().values) << effect.name;
      }
    }
  }
}

}  // namespace
}  // namespace calib::dem
