#include "server/diagnosis/screen_shares.h"

#include <gtest/gtest.h>

#include "server/diagnosis/race_list.h"

namespace calib::diagnosis {
namespace {

// All of the catalogue; what a load cell does is calculated.
struct Effects {
  std::vector<const dem::EffectInfo*> effects;
  std::vector<bool> calculated;
};
Effects FirstOfCatalogue(std::size_t count) {
  Effects first;
  for (const dem::EffectInfo& effect : dem::Effects()) {
    if (first.effects.size() == count) break;
    first.effects.push_back(&effect);
    first.calculated.push_back(effect.name == "load_cell_error");
  }
  return first;
}

std::int64_t Evaluations(const ScreenShares& shares, int experiments) {
  std::size_t runs = 0;
  for (const std::size_t own : shares.runs) runs += own;
  return static_cast<std::int64_t>(shares.numerical) * experiments +
         static_cast<std::int64_t>(runs) * shares.experiments;
}

constexpr std::size_t kNumerical = 3;

TEST(SharesOfScreen, KeepTheCapAndGoWhereTheyTellMost) {
  const auto [effects, calculated] = FirstOfCatalogue(dem::Effects().size());
  for (const int experiments : {1, 2, 3}) {
    for (const std::size_t samples : {24U, 96U, 400U}) {
      const ScreenShares shares =
          SharesOfScreen(effects, calculated, samples, experiments, kNumerical);
      bool instruments = true;  // all of them twice
      bool rays = true;
      for (std::size_t e = 0; e < effects.size(); ++e) {
        EXPECT_GE(shares.runs[e], calculated[e] ? 0U : 1U) << effects[e]->name;
        if (calculated[e]) {
          EXPECT_EQ(shares.runs[e], 0U);
        } else if (effects[e]->rays.size() > 1) {
          rays = rays && shares.runs[e] == 2;
        } else if (effects[e]->kind == "measurement") {
          instruments = instruments && shares.runs[e] == 2;
        }
      }
      EXPECT_LE(static_cast<std::size_t>(Evaluations(shares, experiments)),
                std::max(4 * effects.size(), samples * static_cast<std::size_t>(experiments) / 4))
          << experiments << " experiments, " << samples << " samples";
      EXPECT_EQ(shares.numerical, kNumerical);
      EXPECT_EQ(shares.experiments, experiments);
      EXPECT_TRUE(rays || !instruments);
      if (samples == 400) {
        EXPECT_TRUE(rays && instruments);
      }
    }
  }
}

// One run of each of 16 effects and three numerical choices in four experiments are 72 evaluations.
TEST(SharesOfScreen, KeepTheCapOfManyExperimentsAndFewSamples) {
  for (std::size_t count = 1; count <= dem::Effects().size(); ++count) {
    const auto [effects, calculated] = FirstOfCatalogue(count);
    for (int experiments = 1; experiments <= 12; ++experiments) {
      for (const std::size_t samples : {2U, 12U, 30U, 60U, 96U}) {
        for (const std::size_t numerical : {std::size_t{0}, kNumerical}) {
          const ScreenShares shares =
              SharesOfScreen(effects, calculated, samples, experiments, numerical);
          EXPECT_LE(static_cast<std::size_t>(Evaluations(shares, experiments)),
                    std::max(4 * count, samples * static_cast<std::size_t>(experiments) / 4))
              << count << " effects, " << experiments << " experiments, " << samples << " samples";
          EXPECT_GE(shares.experiments, 1);
          EXPECT_LE(shares.experiments, experiments);
          for (std::size_t e = 0; e < count; ++e) EXPECT_EQ(shares.runs[e] == 0, calculated[e]);
        }
      }
    }
  }
}

TEST(SharesOfScreen, GiveUpExperimentsBeforeNumericalChoices) {
  auto [effects, calculated] = FirstOfCatalogue(16);
  calculated[0] = true;
  for (const int experiments : {4, 5, 6}) {
    const ScreenShares few = SharesOfScreen(effects, calculated, 30, experiments, kNumerical);
    EXPECT_EQ(few.experiments, 3) << experiments;
    EXPECT_EQ(few.numerical, kNumerical) << experiments;
    const ScreenShares more = SharesOfScreen(effects, calculated, 96, experiments, kNumerical);
    EXPECT_EQ(more.experiments, experiments);
    EXPECT_EQ(more.numerical, kNumerical);
  }
}

TEST(ScreenedPart, ShowsWhatAllExperimentsShow) {
  campaign::Campaign campaign;
  campaign.experiments.resize(5);
  for (campaign::Experiment& experiment : campaign.experiments) {
    experiment.test = "triaxial_drained";
    experiment.settings["confining_pressure"] = 2e5;
  }
  campaign.experiments[0].role = campaign::Role::kValidate;
  campaign.experiments[3].settings["confining_pressure"] = 5e5;
  campaign.experiments[4].loading_rate = 0.1;
  const std::vector<const dem::EffectInfo*> effects = {
      dem::FindEffect("pressure_dependent_friction"), dem::FindEffect("viscous_damping"),
      dem::FindEffect("rolling_resistance")};
  const auto fitted = [&campaign, &effects](int count) {
    std::vector<std::size_t> numbers;
    const campaign::Campaign part = ScreenedPart(campaign, effects, count);
    for (std::size_t e = 0; e < part.experiments.size(); ++e) {
      if (part.experiments[e].role == campaign::Role::kCalibrate) numbers.push_back(e);
    }
    return numbers;
  };
  EXPECT_EQ(fitted(1), std::vector<std::size_t>({4})) << "in motion: damping";
  EXPECT_EQ(fitted(2), std::vector<std::size_t>({3, 4})) << "another pressure: friction";
  EXPECT_EQ(fitted(3), std::vector<std::size_t>({1, 3, 4})) << "the first of equals";
  EXPECT_EQ(fitted(4), std::vector<std::size_t>({1, 2, 3, 4})) << "all";
}

// The engine refuses shapes and crushing wherever a test pours spheres: no run of a screen may ask
// for them.
TEST(WhyNotShown, GrainsOfAPouredTestMayKeepTheirShape) {
  campaign::Campaign campaign;
  campaign.experiments.resize(1);
  campaign.experiments[0].test = "silo_discharge";
  const auto why = [&campaign](const char* effect) {
    return WhyNotShown(campaign, *dem::FindEffect(effect));
  };
  EXPECT_NE(why("initial_density"), "");
  EXPECT_NE(why("initial_fabric"), "");
  EXPECT_EQ(why("wall_friction"), "");
  campaign.experiments.resize(2);
  campaign.experiments[1].test = "triaxial_drained";
  EXPECT_EQ(why("initial_density"), "") << "of the triaxial specimen";
  EXPECT_EQ(why("nonspherical_shape"), "");
  EXPECT_EQ(why("particle_crushing"),
            "test silo_discharge pours its grains, which it leaves whole");
  campaign.experiments[0].test = "collision";
  EXPECT_EQ(why("particle_crushing"), "");
}

TEST(WhyNotShown, WhatDependsOnPressureShowsWhereThatDiffers) {
  campaign::Campaign campaign;
  campaign.experiments.resize(2);
  for (campaign::Experiment& experiment : campaign.experiments) {
    experiment.test = "triaxial_drained";
    experiment.settings["confining_pressure"] = 2e5;
  }
  const auto why = [&campaign] {
    return WhyNotShown(campaign, *dem::FindEffect("pressure_dependent_friction"));
  };
  EXPECT_EQ(why(),
            "it shows only between tests at different pressures, or in one whose pressure changes");
  campaign.experiments[1].settings["confining_pressure"] = 4e5;
  EXPECT_EQ(why(), "");
  campaign.experiments.resize(1);
  for (const char* test : {"oedometric", "isotropic", "triaxial_undrained", "collision"}) {
    campaign.experiments[0].test = test;
    EXPECT_EQ(why(), "") << test;
  }
}

}  // namespace
}  // namespace calib::diagnosis
