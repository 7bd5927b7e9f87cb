// Several materials: pairs against closed forms, mixtures of one material against that material.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dem/dynamics/assembly.h"
#include "dem/dynamics/flow.h"
#include "dem/particles/material_shares.h"
#include "dem/registry/catalog.h"
#include "dem/registry/registry.h"
#include "dem/registry/scenario_problems.h"
#include "dem/simulate/packing_generator.h"
#include "dem/simulate/simulate.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Solid {
  double modulus, poisson, density;
};
constexpr Solid kAluminium{7.1e10, 0.33, 2700};
constexpr Solid kSteel{2.1e11, 0.3, 7850};

/// E* of two bodies [Johnson 1985, Eq. 4.20c].
double Hertz(const Solid& a, const Solid& b) {
  return 1 / ((1 - a.poisson * a.poisson) / a.modulus + (1 - b.poisson * b.poisson) / b.modulus);
}

/// G* of two bodies [Mindlin & Deresiewicz 1953].
double Mindlin(const Solid& a, const Solid& b) {
  const auto part = [](const Solid& s) {
    return (2 - s.poisson) * 2 * (1 + s.poisson) / s.modulus;
  };
  return 1 / (part(a) + part(b));
}

double MassOf(const Solid& solid, double radius) {
  return 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3) * solid.density;
}

/// Aluminium grains; steel besides.
Model Metals() {
  Model model;
  model.contact = "hertz_mindlin";
  model.density = kAluminium.density;
  model.materials = {"steel"};
  model.parameters = {
      {"young_modulus", kAluminium.modulus},   {"poisson_ratio", kAluminium.poisson},
      {"friction_coefficient", 0.5},           {"steel.young_modulus", kSteel.modulus},
      {"steel.poisson_ratio", kSteel.poisson}, {"steel.density", kSteel.density}};
  return model;
}

Scenario Collide(Model model, std::map<std::string, double> settings) {
  Scenario s;
  s.model = std::move(model);
  s.test = "collision";
  s.settings = std::move(settings);
  s.materials.bodies = {{"partner", "steel"}};
  s.path = {{.target = 0.1, .load_step = 0}, {.target = 2, .load_step = 1}};
  return s;
}

double Value(const State& state, const std::string& observable) {
  const auto& names = FindTest("collision")->observables;
  return state.values[static_cast<std::size_t>(std::find(names.begin(), names.end(), observable) -
                                               names.begin())];
}

void ExpectHertz(const test::Run& run, double mass, double radius) {
  const double stiffness = 4.0 / 3.0 * Hertz(kAluminium, kSteel) * std::sqrt(radius);
  ASSERT_EQ(run.states.size(), 2U) << run.summary.reason;
  for (const State& state : run.states) {
    const double v = Value(state, "impact_speed");
    const double peak = std::pow(1.25 * mass * v * v / stiffness, 0.4);
    const double duration = 0.8 * std::beta(0.4, 0.5) * peak / v;
    EXPECT_NEAR(Value(state, "peak_overlap"), peak, 1e-6 * peak);
    EXPECT_NEAR(Value(state, "contact_duration"), duration, 4e-4 * duration);
    EXPECT_NEAR(Value(state, "normal_restitution"), 1, 1e-6);
  }
}

TEST(MaterialPair, AluminiumHitsSteelAsHertzSays) {
  const double small = 0.01;
  const double large = 0.025;
  const double m1 = MassOf(kAluminium, small);
  const double m2 = MassOf(kSteel, large);
  const test::Run on_sphere = test::RunAll(
      Collide(Metals(), {{"radius", small}, {"partner_radius", large}, {"impact_angle", 0}}));
  ExpectHertz(on_sphere, m1 * m2 / (m1 + m2), small * large / (small + large));
  const test::Run on_wall =
      test::RunAll(Collide(Metals(), {{"radius", small}, {"impact_angle", 0}}));
  ExpectHertz(on_wall, m1, small);
}

TEST(MaterialPair, TwoGrainsKeepMomentumAndPartAsTheirMassesSay) {
  const double r = 0.01;
  const double along[3] = {1, 0, 0};
  Packing packing = test::TwoSpheres(r, 2.001 * r, along);
  packing.material = {"", "steel"};
  Assembly assembly(packing, kAluminium.density, ContactModelOf(Metals()), Surroundings{}, 1);
  ParticleArrays& p = assembly.mutable_particles();
  const std::size_t light = p.material[0] == 0 ? 0 : 1;
  const double m1 = MassOf(kAluminium, r);
  const double m2 = MassOf(kSteel, r);
  EXPECT_NEAR(1 / p.inverse_mass[light], m1, 1e-12 * m1);
  EXPECT_NEAR(1 / p.inverse_mass[1 - light], m2, 1e-12 * m2);
  const double v = 0.5;
  p.vx[light] = v;
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const double dt = 0.02 * assembly.NominalCriticalStep();
  bool touched = false;
  for (int step = 0; step < 200000 && !(touched && assembly.contacts() == 0); ++step) {
    assembly.Move({.dt = dt});
    ASSERT_TRUE(assembly.EvaluateForces().ok());
    touched = touched || assembly.contacts() > 0;
  }
  ASSERT_TRUE(touched);
  EXPECT_NEAR(m1 * p.vx[light] + m2 * p.vx[1 - light], m1 * v, 1e-12 * m1 * v);
  EXPECT_NEAR(p.vx[light], (m1 - m2) / (m1 + m2) * v, 1e-4 * v);
  EXPECT_NEAR(p.vx[1 - light], 2 * m1 / (m1 + m2) * v, 1e-4 * v);
}

TEST(MaterialPair, GrossSlidingTakesTheFrictionOfThePair) {
  // vt'/vt = 1 - mu (1 + e)/tan(theta) while the contact slides all along.
  const double angle = 1.3;
  const auto restitution = [&](const Model& model) {
    Scenario s = Collide(model, {{"radius", 0.01}, {"impact_angle", angle}});
    const test::Run run = test::RunAll(s);
    return run.states.empty() ? std::nan("") : Value(run.states[0], "tangential_restitution");
  };
  Model stated = Metals();
  stated.parameters["grains-steel.friction_coefficient"] = 0.15;
  EXPECT_NEAR(restitution(stated), 1 - 2 * 0.15 / std::tan(angle), 1e-5);
  Model smaller = Metals();  // by default the smaller of 0.5 and 0.1
  smaller.parameters["steel.friction_coefficient"] = 0.1;
  EXPECT_NEAR(restitution(smaller), 1 - 2 * 0.1 / std::tan(angle), 1e-5);
}

TEST(MaterialPair, DampingRatioOfThePairSetsItsRestitution) {
  // Linear springs whose contact ends where the force does [Schwager & Poeschel 2007, Eq. 14].
  const auto expected = [](double beta) {
    const double root = std::sqrt(1 - beta * beta);
    return std::exp(-beta / root *
                    (std::numbers::pi - std::atan(2 * beta * root / (1 - 2 * beta * beta))));
  };
  Model model = Metals();
  model.contact = "linear";
  model.effects = {"viscous_damping"};
  model.parameters["viscous_damping.ratio"] = 0.4;
  model.parameters["steel-grains.viscous_damping.ratio"] = 0.1;
  for (const double partner : {0.01, 0.03}) {
    const test::Run run = test::RunAll(
        Collide(model, {{"radius", 0.01}, {"partner_radius", partner}, {"impact_angle", 0}}));
    ASSERT_EQ(run.states.size(), 2U) << run.summary.reason;
    for (const State& state : run.states) {  // whatever the speed
      EXPECT_NEAR(Value(state, "normal_restitution"), expected(0.1), 2e-3);
    }
  }
}

TEST(MaterialPair, StiffnessesOfEveryLawAreInSeries) {
  const double r = 0.01;
  const double u = 1e-6;
  const auto evaluate = [&](const Model& model, ContactBlock& block) {
    const ContactModel contact = ContactModelOf(model);
    block.mixed = true;
    for (int k = 0; k < kBlock; ++k) {
      block.radius_i[k] = block.radius_j[k] = r;
      block.dx[k] = 2 * r - u;
      block.vx[k] = -1;
      block.materials[k] = contact.materials()->Pair(k % 2, 1 - k % 2);
    }
    block.sliding_friction = contact.sliding_friction();
    contact.Evaluate(block);
  };
  ContactBlock block{};
  evaluate(Metals(), block);
  const double a = std::sqrt(0.5 * r * u);
  for (int k = 0; k < kBlock; ++k) {
    EXPECT_NEAR(block.normal_stiffness[k], 2 * Hertz(kAluminium, kSteel) * a,
                1e-12 * block.normal_stiffness[k]);
    EXPECT_NEAR(block.tangential_stiffness[k], 8 * Mindlin(kAluminium, kSteel) * a,
                1e-12 * block.tangential_stiffness[k]);
  }
  Model linear = Metals();
  linear.contact = "linear";
  evaluate(linear, block);
  const double k1 = kAluminium.modulus * r;  // kn = 2E r*, among equals
  const double k2 = kSteel.modulus * r;
  EXPECT_NEAR(block.normal_stiffness[0], 2 * k1 * k2 / (k1 + k2), 1e-12 * k1);
  const double s1 = kAluminium.poisson * k1;
  const double s2 = kSteel.poisson * k2;
  EXPECT_NEAR(block.tangential_stiffness[0], 2 * s1 * s2 / (s1 + s2), 1e-12 * s1);
  Model tsuji = Metals();
  tsuji.contact = "tsuji";
  tsuji.parameters["tangential_stiffness"] = 1e6;
  tsuji.parameters["steel.tangential_stiffness"] = 3e6;
  tsuji.parameters["damping"] = 10;
  tsuji.parameters["grains-steel.damping"] = 40;
  evaluate(tsuji, block);
  EXPECT_NEAR(block.tangential_stiffness[0], 1.5e6, 1e-3);
  EXPECT_NEAR(block.normal_damping[0], 40 * std::pow(u, 0.25), 1e-12);
  const double elastic =
      4.0 / 3.0 * Hertz(kAluminium, kSteel) * std::sqrt(0.5 * r) * std::pow(u, 1.5);
  EXPECT_NEAR(block.normal_force[0] - block.normal_damping[0], elastic, 1e-11 * elastic);
}

TEST(MaterialStack, EveryContactIsPressedInAsItsPairSays) {
  // A steel grain on an aluminium one on a floor of steel.
  const double r = 0.01;
  const double g = 9.81;
  const double up[3] = {0, 0, 1};
  Packing packing = test::TwoSpheres(r, 2 * r, up);
  packing.z = {r, 3 * r};
  packing.material = {"grains", "steel"};
  Assembly assembly(packing, kAluminium.density, ContactModelOf(Metals()),
                    {.gravity = {0, 0, -g},
                     .walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1})},
                     .material = "steel"},
                    1);
  Flow flow(assembly,
            {.damping = 0.7,
             .drop_height = 1e-6,
             .low = {-1, -1, -1},
             .high = {101 * r, 101 * r, 101 * r}},
            {});
  ASSERT_EQ(flow.Advance(2e-2), StageEnd::kDone) << flow.reason();
  const ParticleArrays& p = assembly.particles();
  const std::size_t top = p.z[0] > p.z[1] ? 0 : 1;
  const double stiffness = 4.0 / 3.0 * Hertz(kAluminium, kSteel);
  const double w = MassOf(kSteel, r) * g;
  const double both = w + MassOf(kAluminium, r) * g;
  const double between = std::pow(w / (stiffness * std::sqrt(0.5 * r)), 2.0 / 3.0);
  const double below = std::pow(both / (stiffness * std::sqrt(r)), 2.0 / 3.0);
  EXPECT_NEAR(2 * r - (p.z[top] - p.z[1 - top]), between, 1e-4 * between);
  EXPECT_NEAR(r - p.z[1 - top], below, 1e-4 * below);
  EXPECT_NEAR(-assembly.walls().ForceOn(0).z, both, 1e-4 * both);
}

TEST(MaterialIncline, GrainSlidesByTheFrictionOfThePair) {
  Model model = Metals();
  model.parameters["young_modulus"] = 1e9;
  model.parameters["steel.young_modulus"] = 3e9;
  model.parameters["grains-steel.friction_coefficient"] = 0.2;
  const double expected = 9.81 * (std::sin(1.0) - 0.2 * std::cos(1.0));
  EXPECT_NEAR(test::AccelerationDownASlope(model, "steel", 1.0), expected, 2e-3 * expected);
}

/// The scenario with a material beside its own that has the same values.
Scenario OfTwins(Scenario scenario) {
  scenario.model.materials = {"twin"};
  scenario.materials.grains = {{"twin", 0.4}};
  return scenario;
}

void ExpectSameBits(const Scenario& a, const Scenario& b) {
  const test::Run one = test::RunAll(a);
  const test::Run other = test::RunAll(b);
  ASSERT_EQ(one.summary.outcome, Outcome::kCompleted) << one.summary.reason;
  EXPECT_EQ(one.summary.steps, other.summary.steps);
  EXPECT_EQ(one.summary.contact_updates, other.summary.contact_updates);
  ASSERT_EQ(one.states.size(), other.states.size());
  for (std::size_t s = 0; s < one.states.size(); ++s) {
    EXPECT_EQ(one.states[s].values, other.states[s].values) << "state " << s;
  }
}

Scenario Pour(const std::string& name, const std::vector<double>& controls) {
  Scenario scenario;
  scenario.model.contact = "hertz_mindlin";
  scenario.model.density = 2500;
  scenario.model.effects = {"viscous_damping", "rolling_resistance"};
  scenario.model.parameters = {{"young_modulus", 5e6},
                               {"poisson_ratio", 0.25},
                               {"friction_coefficient", 0.5},
                               {"viscous_damping.ratio", 0.3},
                               {"rolling_resistance.stiffness_ratio", 0.5},
                               {"rolling_resistance.friction", 0.1}};
  scenario.test = name;
  const auto sizes =
      GenerateSizes({.particles = 60, .mean_radius = 0.002, .radius_spread = 0.15, .seed = 3});
  EXPECT_TRUE(sizes.ok());
  scenario.packing = *sizes;
  scenario.seed = 5;
  for (std::size_t k = 0; k < controls.size(); ++k) {
    scenario.path.push_back({.target = controls[k], .load_step = static_cast<int>(k)});
  }
  return scenario;
}

TEST(Mixture, OfTwinsHasTheBitsOfOneMaterial) {
  Scenario scenario = test::SmallTriaxial(test::HertzModel());
  ExpectSameBits(scenario, OfTwins(scenario));
  scenario.consolidation.friction_coefficient = 0.2;
  scenario = test::With(
      test::With(scenario, "rolling_resistance", {{"stiffness_ratio", 1.0}, {"friction", 0.2}}),
      "viscous_damping", {{"ratio", 0.2}});
  scenario.loading_rate = 1;
  ExpectSameBits(scenario, OfTwins(scenario));
  scenario.loading_rate.reset();
  scenario =
      test::With(scenario, "twisting_resistance", {{"stiffness_ratio", 0.5}, {"friction", 0.1}});
  scenario = test::With(scenario, "linear_cohesion", {{"energy_density", 1e5}});
  scenario =
      test::With(scenario, "capillary_bridges", {{"surface_tension", 5}, {"volume_ratio", 1e-3}});
  ExpectSameBits(test::With(scenario, "adhesion_dmt", {{"work_of_adhesion", 5}}),
                 OfTwins(test::With(scenario, "adhesion_dmt", {{"work_of_adhesion", 5}})));
  ExpectSameBits(test::With(scenario, "adhesion_jkr", {{"work_of_adhesion", 5}}),
                 OfTwins(test::With(scenario, "adhesion_jkr", {{"work_of_adhesion", 5}})));
  scenario = test::SmallTriaxial(test::LinearModel());
  ExpectSameBits(scenario, OfTwins(scenario));
}

TEST(Mixture, OfTwinsBetweenWallsOfTheSameHasTheBitsOfOneMaterial) {
  const Scenario heap = Pour("angle_of_repose", {1});
  Scenario twins = OfTwins(heap);
  twins.materials.bodies = {{"walls", "twin"}};
  ExpectSameBits(heap, twins);

  Scenario box = Pour("shaken_box", {0.02});
  box.model.contact = "tsuji";
  box.model.effects = {};
  box.model.parameters = {{"young_modulus", 5e6},
                          {"poisson_ratio", 0.25},
                          {"friction_coefficient", 0.5},
                          {"tangential_stiffness", 2e3},
                          {"damping", 0.3}};
  box.settings = {{"thickness", 0.004}};
  twins = OfTwins(box);
  twins.materials.bodies = {{"walls", "twin"}, {"intruder", "twin"}};
  ExpectSameBits(box, twins);
}

TEST(Mixture, HasTheSameBitsOnAnyNumberOfThreadsAndFromACheckpoint) {
  Scenario mixture = test::SmallTriaxial(test::HertzModel());
  mixture.model.materials = {"soft"};
  mixture.model.parameters["soft.young_modulus"] = 1e8;
  mixture.model.parameters["soft.density"] = 1000;
  mixture.model.parameters["grains-soft.friction_coefficient"] = 0.3;
  mixture.materials.grains = {{"soft", 0.3}};
  Scenario other = mixture;
  other.threads = 2;
  ExpectSameBits(mixture, other);

  Scenario silo = Pour("silo_discharge", {0.012, 0.03});
  silo.model.materials = {"soft"};
  silo.model.parameters["soft.young_modulus"] = 2e6;
  silo.materials.grains = {{"soft", 0.3}};
  silo.materials.bodies = {{"walls", "soft"}};
  for (const Scenario& scenario : {mixture, silo}) {
    SCOPED_TRACE(scenario.test);
    std::vector<std::string> kept;
    std::vector<State> states;
    const auto keep = [&](const std::string& bytes) {
      kept.push_back(bytes);
      return absl::OkStatus();
    };
    const auto whole = Simulate(scenario, [&](const State& state) { states.push_back(state); }, {},
                                {.checkpoint = keep});
    ASSERT_TRUE(whole.ok()) << whole.status();
    ASSERT_GE(kept.size(), 2U) << whole->reason;
    std::vector<State> again;
    const auto resumed = Simulate(scenario, [&](const State& state) { again.push_back(state); }, {},
                                  {.resume_from = kept.front()});
    ASSERT_TRUE(resumed.ok()) << resumed.status();
    ASSERT_EQ(again.size(), states.size());
    for (std::size_t s = 0; s < states.size(); ++s) {
      EXPECT_EQ(again[s].values, states[s].values) << "state " << s;
    }
    Scenario changed = scenario;
    changed.materials.grains = {{"soft", 0.5}};
    EXPECT_THAT(CheckpointProblem(changed, kept.front()), HasSubstr("what differs: materials"));
  }
}

TEST(Mixture, OfASoftMaterialIsTheSofterTheMoreThereIsOfIt) {
  double last = 0;
  for (const double share : {0.0, 0.5, 1.0}) {
    Scenario scenario = test::SmallTriaxial(test::HertzModel());
    scenario.test = "isotropic";
    scenario.path = {{.target = 2e5, .load_step = 0}, {.target = 4e5, .load_step = 1}};
    scenario.model.materials = {"soft"};
    scenario.model.parameters["soft.young_modulus"] = 1e8;
    if (share > 0) scenario.materials.grains = {{"soft", share}};
    const test::Run run = test::RunAll(scenario);
    ASSERT_EQ(run.states.size(), 2U) << run.summary.reason;
    const auto& names = FindTest("isotropic")->observables;
    const auto at = static_cast<std::size_t>(
        std::find(names.begin(), names.end(), "volumetric_strain") - names.begin());
    const double strain = run.states[1].values[at] - run.states[0].values[at];
    EXPECT_GT(strain, 1.5 * last);
    last = strain;
  }
}

TEST(Mixture, FollowsFromTheSeedOfTheSpecimenAlone) {
  Scenario scenario = test::SmallTriaxial(test::HertzModel());
  scenario.model.materials = {"soft"};
  scenario.model.parameters["soft.young_modulus"] = 1e8;
  scenario.materials = {.grains = {{"soft", 0.3}}, .seed = 7};
  Scenario sample = scenario;  // another one of the same packing
  sample.seed = scenario.seed + 1;
  ExpectSameBits(scenario, sample);
  Scenario realization = scenario;
  realization.materials.seed = 8;
  EXPECT_NE(test::RunAll(scenario).states.back().values,
            test::RunAll(realization).states.back().values);
}

TEST(DrawMaterials, GivesEachItsShareAndTheSameToTheSameSeed) {
  Packing packing = test::SmallPacking(60);
  DrawMaterials({{"a", 0.25}, {"b", 0.5}}, 3, packing);
  const auto count = [&](const std::string& name) {
    return std::count(packing.material.begin(), packing.material.end(), name);
  };
  EXPECT_EQ(count("a"), 15);
  EXPECT_EQ(count("b"), 30);
  EXPECT_EQ(count(""), 15);
  Packing again = test::SmallPacking(60);
  DrawMaterials({{"a", 0.25}, {"b", 0.5}}, 3, again);
  EXPECT_EQ(again.material, packing.material);
  DrawMaterials({{"a", 0.25}, {"b", 0.5}}, 4, again);
  EXPECT_NE(again.material, packing.material);
  std::vector<PackingProblem> problems;
  EXPECT_EQ(ParsePacking(FormatPacking(packing), problems).material, packing.material);
  EXPECT_THAT(problems, IsEmpty());
}

TEST(MaterialProblems, AreSaidOneByOne) {
  Scenario scenario = test::SmallTriaxial(test::HertzModel());
  const auto with = [&](const auto& change) {
    Scenario changed = scenario;
    change(changed);
    return ScenarioProblems(changed);
  };
  scenario.model.materials = {"soft"};
  EXPECT_THAT(ScenarioProblems(scenario), IsEmpty());
  EXPECT_THAT(with([](Scenario& s) { s.model.materials.emplace_back("grains"); }),
              Contains(HasSubstr("is the model's own")));
  EXPECT_THAT(with([](Scenario& s) { s.model.materials.emplace_back("soft"); }),
              Contains(HasSubstr("named twice")));
  EXPECT_THAT(with([](Scenario& s) { s.model.materials.emplace_back("a-b"); }),
              Contains(HasSubstr("letters, digits and _ only")));
  EXPECT_THAT(with([](Scenario& s) { s.model.materials.emplace_back("adhesion_dmt"); }),
              Contains(HasSubstr("the name of an effect")));
  EXPECT_THAT(with([](Scenario& s) { s.model.parameters["soft.young_modulus"] = -1; }),
              Contains(HasSubstr("soft.young_modulus is -1, allowed is [10000, ")));
  EXPECT_THAT(with([](Scenario& s) { s.model.parameters["hard.young_modulus"] = 1e9; }),
              Contains(HasSubstr("no parameter \"hard.young_modulus\"")));
  EXPECT_THAT(
      with([](Scenario& s) { s.model.parameters["grains-soft.viscous_damping.ratio"] = 0.1; }),
      Contains(HasSubstr("no parameter")));  // without viscous_damping
  EXPECT_THAT(with([](Scenario& s) {
                s.model.parameters["grains-soft.friction_coefficient"] = 0.1;
                s.model.parameters["soft-grains.friction_coefficient"] = 0.1;
              }),
              Contains(HasSubstr("are the same; give one of them")));
  EXPECT_THAT(with([](Scenario& s) {
                s.materials.grains = {{"hard", 0.5}};
              }),
              Contains(HasSubstr("is of material \"hard\"; there are grains, soft")));
  EXPECT_THAT(with([](Scenario& s) {
                s.materials.grains = {{"soft", 1.5}};
              }),
              Contains(HasSubstr("allowed is (0, 1]")));
  EXPECT_THAT(with([](Scenario& s) {
                s.materials.bodies = {{"walls", "soft"}};
              }),
              Contains(HasSubstr("has no body \"walls\"")));
  EXPECT_THAT(with([](Scenario& s) { s.packing.material.assign(s.packing.x.size(), "hard"); }),
              Contains(HasSubstr("grains of the packing are of material \"hard\"")));
  EXPECT_THAT(with([](Scenario& s) {
                s.model.effects.emplace_back("nonspherical_shape");
                s.model.parameters["nonspherical_shape.aspect"] = 1.2;
              }),
              Contains(HasSubstr("nonspherical_shape knows one material only")));
}

}  // namespace
}  // namespace calib::dem
