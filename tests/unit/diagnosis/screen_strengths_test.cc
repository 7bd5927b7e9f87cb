#include "server/diagnosis/screen_strengths.h"

#include <gtest/gtest.h>

#include <cmath>

namespace calib::diagnosis {
namespace {

constexpr dem::ReferenceState kState{.pressure = 1e5, .diameter = 1e-3, .modulus = 1e9};

double Second(const std::string& effect, double square) {
  const dem::EffectInfo& info = *dem::FindEffect(effect);
  return SecondStep(info, info.rays.front(), square, "hertz_mindlin", kState) /
         info.rays.front().steps[0];
}

TEST(SecondStep, GrowsWithTheRootOfWhatIsMissing) {
  EXPECT_NEAR(Second("contact_plasticity", 18. / 32), std::sqrt(32), 1e-12) << "18 are wanted";
  EXPECT_NEAR(Second("contact_plasticity", 18. / 64), 8, 1e-12);
  EXPECT_EQ(Second("contact_plasticity", 0.3), Second("contact_plasticity", 0.3001)) << "in grades";
}

// Crushing goes with weakness^3: eight times as much of it wants twice the weakness.
TEST(SecondStep, KnowsHowWhatIsSeenGrowsWithTheStrength) {
  EXPECT_NEAR(Second("particle_crushing", 18. / 64), 2, 1e-12);
}

// The catalogue's second strength is four times its first here.
TEST(SecondStep, IsNoWeakerThanTheCatalogues) {
  EXPECT_NEAR(Second("contact_plasticity", 3.9), 4, 1e-12);
  EXPECT_NEAR(Second("contact_plasticity", 1000), 4, 1e-12);
  EXPECT_NEAR(Second("contact_plasticity", 0), 4, 1e-12) << "nothing to go by";
}

TEST(SecondStep, GoesNoFurtherThanItsPrior) {
  const dem::EffectInfo& density = *dem::FindEffect("initial_density");
  EXPECT_NEAR(Second("initial_density", 1e-3) * density.rays.front().steps[0] * 0.01,
              density.parameters.front().default_prior.max, 1e-12);
  const double membrane = Second("membrane_stiffness", 1e-3);
  EXPECT_NEAR(membrane, 16, 1e-9) << "a wide prior: no more than so many times";
}

// Every effect of the catalogue, whatever its first difference.
TEST(SecondStep, IsAdmissible) {
  for (const dem::EffectInfo& effect : dem::Effects()) {
    for (const dem::StrengthRay& ray : effect.rays) {
      const std::string contact = effect.contacts.empty() ? "hertz_mindlin" : effect.contacts[0];
      for (const double square : {0.0, 0.01, 1.0, 100.0}) {
        const double step = SecondStep(effect, ray, square, contact, kState);
        EXPECT_TRUE(dem::RayAdmits(effect, ray, step, contact, kState)) << effect.name;
        EXPECT_NE(step, ray.steps[0]) << effect.name;
      }
    }
  }
}

}  // namespace
}  // namespace calib::diagnosis
