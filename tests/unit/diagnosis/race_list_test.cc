// Who takes part in a diagnosis, along which parameter, and how far.
#include "server/diagnosis/race_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "server/campaign/file/campaign_file.h"
#include "server/campaign/model/race.h"
#include "server/diagnosis/design_rows.h"
#include "server/methods/registry.h"
#include "tests/support/race_toy.h"
#include "tests/support/sixty_four_grains.h"

namespace calib::diagnosis {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pair;

Race RaceFor(const report::CampaignView& view, const std::vector<std::string>& without = {}) {
  const auto race = RaceOf(view, without);
  EXPECT_TRUE(race.ok()) << race.status();
  return race.ok() ? *race : Race();
}

const RacingEffect& EntryOf(const Race& race, const std::string& strength) {
  const auto found =
      std::find_if(race.effects.begin(), race.effects.end(),
                   [&](const RacingEffect& own) { return own.strength == strength; });
  EXPECT_NE(found, race.effects.end()) << strength;
  return found == race.effects.end() ? race.effects.front() : *found;
}

TEST(RaceList, HasTheEffectsOfTheBuildWithTheirStrengths) {
  const RaceToy toy(1, 1, 1);
  const report::CampaignView view = toy.Measured({}, 1);
  const Race race = RaceFor(view, {"membrane_stiffness"});
  const RacingEffect& rolling = EntryOf(race, "rolling_resistance.friction");
  EXPECT_EQ(rolling.null, 0);
  EXPECT_NEAR(rolling.near, 0.1, 1e-12);
  EXPECT_NEAR(rolling.far, 0.3, 1e-12);
  EXPECT_FALSE(rolling.design.two_sided);
  ASSERT_EQ(rolling.shapes.size(), 1u) << "its stiffness shapes it";
  EXPECT_EQ(rolling.shapes[0].name, "rolling_resistance.stiffness_ratio");
  EXPECT_EQ(rolling.shapes[0].absent, 0) << "as a run without it has it";
  const auto are_kin = [&race](const std::string& a, const std::string& b) {
    return std::any_of(race.kin.begin(), race.kin.end(), [&](const auto& pair) {
      const std::string& one = race.effects[static_cast<std::size_t>(pair.first)].name;
      const std::string& other = race.effects[static_cast<std::size_t>(pair.second)].name;
      return (one == a && other == b) || (one == b && other == a);
    });
  };
  EXPECT_TRUE(are_kin("adhesion_dmt", "capillary_bridges"));
  EXPECT_TRUE(are_kin("rolling_resistance", "nonspherical_shape"));
  EXPECT_TRUE(are_kin("apparatus_compliance", "strain_offset"));
  EXPECT_FALSE(are_kin("rolling_resistance", "adhesion_dmt"));
  EXPECT_FALSE(are_kin("load_cell_error", "load_cell_error")) << "strengths of one effect";
  EXPECT_FALSE(are_kin("contact_plasticity", "hertz_nonlinearity")) << "neither is of a family";
  // Gain and offset each act alone.
  EXPECT_TRUE(EntryOf(race, "load_cell_error.gain").design.two_sided);
  EXPECT_THAT(EntryOf(race, "load_cell_error.offset").shapes, IsEmpty());
  EXPECT_THAT(race.Names(), Contains("load_cell_error").Times(1));
  EXPECT_THAT(race.not_excitable, Contains(Pair("membrane_stiffness", "left out as asked for")));
  EXPECT_THAT(race.not_excitable, Contains(Pair("viscous_damping", HasSubstr("at rest"))));
  EXPECT_THAT(race.not_excitable, Contains(Pair("wall_friction", HasSubstr("none of the fitted"))));
  EXPECT_THAT(race.Names(), Not(Contains("wall_friction")));
  const auto place = [&race](const std::string& name) {
    return static_cast<int>(
        std::find_if(race.effects.begin(), race.effects.end(),
                     [&name](const RacingEffect& own) { return own.name == name; }) -
        race.effects.begin());
  };
  EXPECT_THAT(race.excluded, Contains(Pair(place("adhesion_dmt"), place("adhesion_jkr"))));
  EXPECT_EQ(race.numerics.size(), 3u);
}

TEST(RaceList, HasUsersEffectsWithTheirSignsAndEnds) {
  const RaceToy toy(7, 1, 1);
  const report::CampaignView view = toy.Measured({}, 1);
  const Race race = RaceFor(view, RaceToy::Without());
  ASSERT_EQ(race.effects.size(), 7u);
  EXPECT_TRUE(race.effects[2].design.two_sided);
  EXPECT_NEAR(race.effects[2].most, race.effects[2].most_other, 1e-12);
  EXPECT_FALSE(race.effects[2].ends) << "its prior ends before it does";
  EXPECT_EQ(race.effects[0].most_other, 0);
  EXPECT_EQ(race.effects[3].design.shapes, 1);
  EXPECT_EQ(race.effects[1].design.power, 0.75);
  EXPECT_THAT(race.excluded, ElementsAre(std::pair(1, 5)));
}

TEST(RaceList, ADesignAdmitsEveryRowOfItsRace) {
  const RaceToy toy(4, 1, 2);
  const report::CampaignView view = toy.Measured({}, 1);
  const Race race = RaceFor(view, RaceToy::Without());
  const campaign::Campaign design = CampaignOfDesign(view.campaign, race);
  const DesignRows rows(
      AxesOver(campaign::MarginalPriors(view.campaign), Eigen::MatrixXd{{0.5e9, 0.3}, {1e9, 0.6}}),
      race, Eigen::VectorXd::Constant(4, 0.3));
  ASSERT_EQ(rows.names().size(), design.parameters.size());
  for (std::size_t j = 0; j < rows.names().size(); ++j)
    EXPECT_EQ(rows.names()[j], design.parameters[j].name);
  inference::DesignPoints points{.base = Eigen::MatrixXd::Zero(3, 2),
                                 .strength = Eigen::MatrixXd::Zero(3, 4),
                                 .shape = Eigen::MatrixXd::Zero(3, 1)};
  points.strength.row(1) << 1e-9, 1e9, -1e9, 0.5;
  points.strength.row(2) << 0, 0, 2, 0;
  for (Eigen::Index i = 0; i < 3; ++i)
    EXPECT_EQ(campaign::WhyNotRun(design, rows.Values(points, i)), "") << i;
  EXPECT_THAT(campaign::ActiveEffects(design, rows.Values(points, 0)), IsEmpty());
  EXPECT_THAT(campaign::ActiveEffects(design, rows.Values(points, 2)), ElementsAre("e2"));
  EXPECT_EQ(campaign::WhyNotRun(design, rows.WithNumerics(rows.Values(points, 0), 1)), "");
  const campaign::Derivation text = DesignOf(view, race);
  EXPECT_EQ(text.lineage.purpose, "design");
  EXPECT_EQ(text.parameters.size() + 2, design.parameters.size());
  EXPECT_THAT(*text.race, ElementsAre("e0", "e1", "e2", "e3"));
}

// What is submitted: the text, read as the server reads it.
TEST(RaceList, TheTextOfADesignIsReadBackAsItsCampaign) {
  const auto read = [](const std::string& text) {
    return campaign::ReadCampaign(methods::All(), text, "c.yaml", [](const std::string&) {
      return std::string(
          "axial_strain,q_over_p,volumetric_strain\n0.002,0.5,0.0008\n0.005,0.8,0.0012\n"
          "0.01,1.0,0.001\n");
    });
  };
  const std::string base = calib::testing::SixtyFourGrains(
      "{q_over_p: {noise: {absolute: 0.3}}, volumetric_strain: {noise: {absolute: 0.002}}}", 12, 2);
  const campaign::ReadOutcome parent = read(base);
  ASSERT_THAT(parent.problems, IsEmpty());
  report::CampaignView view;
  view.campaign = parent.campaign;
  view.status.set_campaign("c1");
  const Race race = RaceFor(view);
  ASSERT_GT(race.effects.size(), 10U);
  const auto text = campaign::Derive(methods::All(), base, DesignOf(view, race));
  ASSERT_TRUE(text.ok()) << text.status();
  const campaign::ReadOutcome outcome = read(*text);
  std::string problems;
  for (const campaign::Problem& problem : outcome.problems) problems += problem.message + "\n";
  ASSERT_EQ(problems, "") << *text;
  const campaign::Campaign expected = CampaignOfDesign(view.campaign, race);
  const campaign::Campaign& design = outcome.campaign;
  EXPECT_EQ(design.method->name(), "design");
  EXPECT_EQ(design.race, expected.race);
  ASSERT_EQ(design.parameters.size(), expected.parameters.size());
  for (const campaign::CalibratedParameter& own : expected.parameters) {
    const auto found = std::find_if(design.parameters.begin(), design.parameters.end(),
                                    [&own](const auto& other) { return other.name == own.name; });
    ASSERT_NE(found, design.parameters.end()) << own.name;
    EXPECT_EQ(found->prior.kind, own.prior.kind) << own.name;
    EXPECT_EQ(found->prior.min, own.prior.min) << own.name;
    EXPECT_EQ(found->prior.max, own.prior.max) << own.name;
  }
}

report::CampaignView RunsOfAnotherCode() {
  report::CampaignView view = RaceToy(1, 1, 1).Measured({}, 1);
  view.campaign.model = {};
  view.campaign.precomputed.emplace();
  for (campaign::Experiment& e : view.campaign.experiments) e.specimens.clear();
  return view;
}

TEST(RaceList, OfRunsThatWereMadeElsewhereHasWhatIsCalculatedOnCurves) {
  const Race race = RaceFor(RunsOfAnotherCode(), {"apparatus_compliance"});
  EXPECT_THAT(race.Names(), ElementsAre("strain_offset", "load_cell_error"));
  ASSERT_EQ(race.effects.size(), 3U);
  for (const RacingEffect& entry : race.effects) {
    EXPECT_THAT(entry.shapes, IsEmpty()) << entry.strength;
    EXPECT_EQ(entry.design.shapes, 0) << entry.strength;
    EXPECT_TRUE(std::isfinite(entry.near) && entry.most >= std::abs(entry.near)) << entry.strength;
  }
  EXPECT_THAT(race.numerics, IsEmpty());
  EXPECT_THAT(race.excluded, IsEmpty());
  EXPECT_THAT(race.not_excitable,
              Contains(Pair("rolling_resistance",
                            "the runs were made elsewhere, none can be made with it")));
  EXPECT_THAT(race.not_excitable,
              Contains(Pair("initial_density", "no fitted test reads porosity or void ratio")));
  EXPECT_THAT(race.not_excitable, Contains(Pair("apparatus_compliance", "left out as asked for")));
}

TEST(RaceList, OfAProgramSaysThatItDoesNotDeclareWhatIsNotCalculated) {
  report::CampaignView view = RunsOfAnotherCode();
  view.campaign.precomputed.reset();
  view.campaign.program.emplace();
  const Race race = RaceFor(view, {});
  EXPECT_THAT(race.Names(), Contains("strain_offset"));
  EXPECT_THAT(
      race.not_excitable,
      Contains(Pair("rolling_resistance", "model.effects of the program has no such effect")));
}

TEST(RaceList, NobodyWhoCanBeCalculatedIsSaid) {
  report::CampaignView view = RunsOfAnotherCode();
  for (campaign::Experiment& e : view.campaign.experiments) e.test.clear();
  const auto race = RaceOf(view, {});
  EXPECT_EQ(race.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(race.status().message(),
              HasSubstr("the runs of this campaign were made elsewhere, and no effect can be "
                        "calculated on what they read: "));
  EXPECT_THAT(race.status().message(),
              HasSubstr("load_cell_error (the readings do not give axial and lateral stress)"));
  EXPECT_THAT(race.status().message(), Not(HasSubstr("rolling_resistance")));
}

TEST(RaceList, NobodyLeftIsSaid) {
  const RaceToy toy(1, 1, 1);
  std::vector<std::string> all = RaceToy::Without();
  all.push_back("e0");
  const auto race = RaceOf(toy.Measured({}, 1), all);
  EXPECT_EQ(race.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(race.status().message(), HasSubstr("no effect of this build can join"));
}

// The engine refuses shapes and crushing wherever a test pours spheres: no run of a design may ask
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
