// Crushing: strength distribution, size effect, mass, and what it does to a compression curve.
#include "dem/dynamics/crushing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dem/registry/catalog.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

TEST(ParticleCrushing, StrengthsAreWeibullWithSizeEffect) {
  const double n[3] = {1, 0, 0};
  const Assembly assembly(test::TwoSpheres(1e-3, 2e-3, n), 2650,
                          ContactModelOf(test::LinearModel()), 1);
  const CrushingLaw law{
      .weakness = 1e-7, .weibull_modulus = 3, .reference_diameter = 2e-3, .size_loss = 0.2};
  const Crushing crushing(law, 5, assembly);
  constexpr int kDraws = 40000;
  for (const double s : {0.5e7, 1e7, 1.5e7}) {
    int survive = 0;
    for (int id = 0; id < kDraws; ++id) {
      survive += crushing.Strength(id, 0, 2e-3) > s ? 1 : 0;
    }
    const double expected = std::exp(-std::pow(s * 1e-7, 3));
    EXPECT_NEAR(survive / static_cast<double>(kDraws), expected, 4 * 0.5 / std::sqrt(kDraws));
  }
  EXPECT_NEAR(crushing.Strength(1, 0, 4e-3) / crushing.Strength(1, 0, 2e-3), 0.5, 1e-12);
  EXPECT_NE(crushing.Strength(1, 1, 2e-3), crushing.Strength(1, 0, 2e-3));
}

TEST(ParticleCrushing, CrushesAtItsStrengthAndKeepsTheMass) {
  const double n[3] = {0.6, 0, 0.8};
  const double r = 1e-3;
  const double overlap = 1e-5;
  Assembly assembly(test::TwoSpheres(r, 2 * r - overlap, n), 2650,
                    ContactModelOf(test::LinearModel()), 1);
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  const double force = 1.2e8 * r * overlap;  // kn = 2 E r/2
  const double solid = assembly.solid_volume();
  CrushingLaw law{
      .weakness = 1, .weibull_modulus = 4, .reference_diameter = 2 * r, .size_loss = 0.25};
  const Crushing probe(law, 1, assembly);
  const double weaker = std::min(probe.Strength(0, 0, 2 * r), probe.Strength(1, 0, 2 * r));
  // Just below and just above the weaker of the two: strengths are in proportion to 1/weakness.
  law.weakness = 0.999 * weaker * 4 * r * r / force;
  EXPECT_EQ(Crushing(law, 1, assembly).Crush(assembly), 0);
  law.weakness = 1.001 * weaker * 4 * r * r / force;
  Crushing crushing(law, 1, assembly);
  EXPECT_EQ(crushing.Crush(assembly), 1);
  double left = 0;
  for (const double radius : assembly.particles().radius) {
    left += 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
  }
  EXPECT_NEAR(left + crushing.FinesVolume(assembly), solid, 1e-12 * solid);
  EXPECT_EQ(assembly.solid_volume(), solid);
  const double lost = 4.0 / 3.0 * std::numbers::pi * r * r * r * (1 - 0.75 * 0.75 * 0.75);
  EXPECT_NEAR(crushing.FinesVolume(assembly), lost, 1e-12 * lost);
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  EXPECT_EQ(assembly.contacts(), 0);  // what is left no longer reaches the other
}

TEST(ParticleCrushing, MakesASpecimenMoreCompressible) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.test = "oedometric";
  s.packing = test::SmallPacking(200);
  s.path = {{.target = 0, .load_step = 0}, {.target = 0.03, .load_step = 1}};
  const auto& names = FindTest("oedometric")->observables;
  const auto at = [&](const State& state, const char* name) {
    return state.values[static_cast<std::size_t>(std::find(names.begin(), names.end(), name) -
                                                 names.begin())];
  };
  const test::Run whole = test::RunAll(s);
  s.model.effects = {"particle_crushing"};
  s.model.parameters["particle_crushing.weakness"] = 0.15 / 2e5;
  s.model.parameters["particle_crushing.reference_diameter"] = 2e-3;
  s.model.parameters["particle_crushing.size_loss"] = 0.05;
  const test::Run crushed = test::RunAll(s);
  ASSERT_EQ(crushed.summary.outcome, Outcome::kCompleted) << crushed.summary.reason;
  std::printf("axial stress at 3 %%: %.3g MPa crushing, %.3g MPa whole\n",
              1e-6 * at(crushed.states[1], "axial_stress"),
              1e-6 * at(whole.states[1], "axial_stress"));
  EXPECT_LT(at(crushed.states[1], "axial_stress"), 0.9 * at(whole.states[1], "axial_stress"));
  // Porosity counts fines as solid: it follows from the strain alone.
  const double n0 = at(crushed.states[0], "porosity");
  const double n1 = at(crushed.states[1], "porosity");
  EXPECT_NEAR((1 - n0) / (1 - n1), std::exp(-0.03), 1e-12);
  s.seed = 1;
  const test::Run other = test::RunAll(s);
  EXPECT_NE(other.states[1].values, crushed.states[1].values);
}

// Fines that fill the pores would carry the load, which the law does not have them do.
TEST(ParticleCrushing, EndsWhereTheFinesNoLongerFitThePores) {
  Scenario s = test::SmallTriaxial(test::HertzModel());
  s.packing = test::SmallPacking(200);
  s.model.effects = {"particle_crushing"};
  s.model.parameters["particle_crushing.weakness"] = 1;  // everything crushes, again and again
  s.model.parameters["particle_crushing.size_loss"] = 0.05;
  const test::Run run = test::RunAll(s);
  EXPECT_EQ(run.summary.outcome, Outcome::kDiverged);
  EXPECT_THAT(run.summary.reason,
              testing::HasSubstr("consolidation: the fines of particle_crushing no longer fit "
                                 "between the grains: they are 0."));
  EXPECT_THAT(run.summary.reason, testing::HasSubstr("(porosity with fines "));
}

}  // namespace
}  // namespace calib::dem
