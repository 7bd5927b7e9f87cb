#include "server/ctl/extension.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <string>

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

TEST(Extension, SaysWhatIsPossibleWithRunsThatWereMadeElsewhere) {
  campaign::Campaign campaign;
  campaign.model.contact = "linear";
  EXPECT_EQ(WhyNotJoin(campaign, "rolling_resistance"), "");
  campaign.precomputed = campaign::Precomputed{};
  const std::string why = WhyNotJoin(campaign, "rolling_resistance");
  EXPECT_THAT(why, HasSubstr("made elsewhere cannot be joined by rolling_resistance"));
  EXPECT_THAT(why, HasSubstr("calibctl diagnose"));
  EXPECT_THAT(WhyNotJoin(campaign, "magic"), HasSubstr("there is no effect magic"));
}

// A model that lacks an effect bends its modulus, by which strengths are scaled.
TEST(Extension, PriorsOfStrengthsAreWideEnoughForEveryModulusThatItMayMoveTo) {
  report::CampaignView view;
  view.campaign.name = "bent";
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
}  // namespace calib::ctl
