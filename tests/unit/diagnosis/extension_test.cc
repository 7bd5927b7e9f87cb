#include "server/diagnosis/extension.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <string>

#include "server/methods/registry.h"

namespace calib::diagnosis {
namespace {

using ::testing::HasSubstr;

TEST(Extension, SaysWhatIsPossibleWithRunsThatWereMadeElsewhere) {
  campaign::Campaign campaign;
  campaign.model.contact = "linear";
  EXPECT_EQ(WhyNotJoin(campaign, "rolling_resistance"), "");
  campaign.model.materials = {"steel"};
  EXPECT_THAT(WhyNotJoin(campaign, "wall_friction"), HasSubstr("knows one material only"));
  campaign.precomputed = campaign::Precomputed{};
  const std::string why = WhyNotJoin(campaign, "rolling_resistance");
  EXPECT_THAT(why, HasSubstr("made elsewhere cannot be joined by rolling_resistance"));
  EXPECT_THAT(why, HasSubstr("calibctl diagnose"));
  EXPECT_THAT(WhyNotJoin(campaign, "magic"), HasSubstr("there is no effect magic"));
}

TEST(Extension, AModelHasOneLawOfAThing) {
  campaign::Campaign campaign;
  campaign.model.contact = "hertz_mindlin";
  campaign.model.effects = {"adhesion_jkr"};
  EXPECT_THAT(WhyNotJoin(campaign, "adhesion_dmt"), HasSubstr("another law of what adhesion_jkr"));
  campaign.model.effects = {"adhesion_dmt"};
  EXPECT_THAT(WhyNotJoin(campaign, "adhesion_jkr"), HasSubstr("one of them, not both"));
  EXPECT_EQ(WhyNotJoin(campaign, "capillary_bridges"), "");
}

// A screen of such an effect was begun before, was refused, and cost the whole diagnosis.
TEST(Extension, OnlySpheresCrush) {
  campaign::Campaign campaign;
  campaign.model.contact = "hertz_mindlin";
  campaign.model.effects = {"particle_crushing"};
  EXPECT_THAT(WhyNotJoin(campaign, "nonspherical_shape"), HasSubstr("only spheres crush"));
  campaign.model.effects = {"nonspherical_shape"};
  EXPECT_THAT(WhyNotJoin(campaign, "particle_crushing"), HasSubstr("only spheres crush"));
  EXPECT_EQ(WhyNotJoin(campaign, "rolling_resistance"), "");
  campaign.model.effects = {};
  EXPECT_EQ(WhyNotJoin(campaign, "particle_crushing"), "");
  campaign::PackingFile file;
  file.packing.clump = {-1, 0, 0};
  campaign.experiments.resize(1);
  campaign.experiments.front().specimens = {file};
  EXPECT_THAT(WhyNotJoin(campaign, "particle_crushing"), HasSubstr("this one has clumps"));
  EXPECT_EQ(WhyNotJoin(campaign, "rolling_resistance"), "");
}

// Strengths are in units of the forces that the test's own contacts carry.
TEST(Extension, TestsWithoutAPressureHaveThatOfTheirWeightOrImpact) {
  report::CampaignView view;
  view.campaign.method = methods::All().standard();
  view.campaign.model.contact = "hertz_mindlin";
  view.campaign.model.density = 2500;
  view.campaign.model.parameters["young_modulus"] = 1e7;
  campaign::Experiment silo;
  silo.test = "silo_discharge";
  silo.specimens = {dem::PackingRecipe{.particles = 1000, .mean_radius = 2e-3}};
  view.campaign.experiments = {silo};
  EXPECT_NEAR(ReferenceOf(view).pressure, 2500 * 9.80665 * 4e-3 * 10, 1e-6);
  EXPECT_DOUBLE_EQ(ReferenceOf(view).diameter, 4e-3);
  view.campaign.experiments[0].settings["gravity"] = 1.62;
  EXPECT_NEAR(ReferenceOf(view).pressure, 2500 * 1.62 * 4e-3 * 10, 1e-6);

  campaign::Experiment impact;
  impact.test = "collision";
  impact.settings = {{"radius", 1e-2}, {"impact_angle", 0}};
  impact.specimens = {campaign::NoPacking{}};
  impact.control_name = "impact_speed";
  impact.path = {{.target = 0.5, .load_step = 0}, {.target = 2, .load_step = 1}};
  view.campaign.experiments = {impact};
  const auto of_impact = [](double speed) {
    return std::pow(2500 * speed * speed, 0.6) * std::pow(1e7, 0.4);
  };
  EXPECT_NEAR(ReferenceOf(view).pressure, of_impact(0.5), 1e-6) << "the gentlest";
  EXPECT_DOUBLE_EQ(ReferenceOf(view).diameter, 2e-2);
  impact.settings = {{"radius", 1e-2}, {"impact_speed", 0.4}};
  impact.control_name = "impact_angle";
  impact.path = {{.target = 0, .load_step = 0}, {.target = 1, .load_step = 1}};
  view.campaign.experiments.push_back(impact);
  EXPECT_NEAR(ReferenceOf(view).pressure, of_impact(0.4 * std::cos(1)), 1e-6);

  campaign::Experiment triaxial;
  triaxial.test = "triaxial_drained";
  triaxial.settings = {{"confining_pressure", 2e5}};
  triaxial.specimens = silo.specimens;
  view.campaign.experiments = {triaxial};
  EXPECT_NEAR(ReferenceOf(view).pressure, 2e5, 1e-6);
}

// A model that lacks an effect bends its modulus, by which strengths are scaled.
TEST(Extension, PriorsOfStrengthsAreWideEnoughForEveryModulusThatItMayMoveTo) {
  report::CampaignView view;
  view.campaign.name = "bent";
  view.campaign.method = methods::All().standard();
  view.campaign.model.contact = "hertz_mindlin";
  view.campaign.parameters.push_back(
      {.name = "young_modulus",
       .unit = "Pa",
       .prior = {.kind = inference::PriorKind::kLogUniform, .min = 2e8, .max = 4e9}});
  view.posterior.set_posterior_from("weights");
  auto& modulus = *view.posterior.add_parameters();
  modulus.set_name("young_modulus");
  modulus.set_mean(6e8);
  view.source.set_campaign_file("model: {contact: hertz_mindlin}\nparameters: {}\n");
  const auto text = ExtensionText(view, {.effects = {"linear_cohesion"}, .purpose = "extension"});
  ASSERT_TRUE(text.ok()) << text.status();
  const YAML::Node prior = YAML::Load(*text)["parameters"]["linear_cohesion.energy_density"];
  const double scale = 0.03 * std::cbrt(1e5);  // times E^(2/3): catalogue, linear_cohesion
  const double low = prior["min"].as<double>();
  const double high = prior["max"].as<double>();
  EXPECT_NEAR(low / (0.01 * scale * std::pow(2e8, 2.0 / 3.0)), 1, 1e-6);
  EXPECT_NEAR(high / (10 * scale * std::pow(4e9, 2.0 / 3.0)), 1, 1e-6);
}

}  // namespace
}  // namespace calib::diagnosis
