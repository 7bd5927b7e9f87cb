#include "server/messages/attempt_spec.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace calib::messages {
namespace {

v1::AttemptSpec Spec() {
  dem::Scenario scenario;
  scenario.model.contact = "linear";
  scenario.model.parameters = {{"young_modulus", 1e9}, {"friction_coefficient", 0.5}};
  scenario.test = "triaxial_drained";
  scenario.path = {{.target = 0.01, .load_step = 0}};
  campaign::PackingFile file;
  file.digest = "abc";
  return ToSpec(scenario, file, "tx");
}

TEST(SpecDigest, NamesWhatDeterminesTheStatesAndNothingElse) {
  const std::string digest = SpecDigest(Spec());
  EXPECT_EQ(digest.size(), 64U);
  v1::AttemptSpec other = Spec();
  other.set_experiment("another name");
  other.set_threads(8);
  EXPECT_EQ(SpecDigest(other), digest);
  other = Spec();
  (*other.mutable_parameters())["young_modulus"] = 1.0000000000000002e9;
  EXPECT_NE(SpecDigest(other), digest);
  other = Spec();
  other.set_packing_digest("abd");
  EXPECT_NE(SpecDigest(other), digest);
  other = Spec();
  other.set_seed(1);
  EXPECT_NE(SpecDigest(other), digest);
  other = Spec();
  other.mutable_staging()->set_rate(0.1);
  EXPECT_NE(SpecDigest(other), digest);
}

TEST(SetResources, SaysWhatTheCampaignWantsAndElseWhatTheWorkerHas) {
  campaign::Campaign campaign;
  v1::Lease lease;
  *lease.mutable_spec() = Spec();
  const std::string digest = RunDigest(lease);
  SetResources(campaign, {.threads = 3, .memory = 2e9}, lease);
  EXPECT_EQ(lease.spec().threads(), 3);
  EXPECT_EQ(lease.limits().memory(), 2e9);
  SetResources(campaign, {.threads = 1, .memory = 1e6}, lease);
  EXPECT_EQ(lease.limits().memory(), 256e6) << "no engine lives on less";
  campaign.resources = {.threads = 2, .memory = 1e9};
  SetResources(campaign, {.threads = 3, .memory = 2e9}, lease);
  EXPECT_EQ(lease.spec().threads(), 2);
  EXPECT_EQ(lease.limits().memory(), 1e9);
  EXPECT_EQ(RunDigest(lease), digest) << "it has no part in what the run is";
}

TEST(SetResources, OfAProgramAreALimitWhereItHasNone) {
  campaign::Campaign campaign;
  v1::Lease lease;
  lease.mutable_program()->add_command("yade");
  SetResources(campaign, {.threads = 3, .memory = 2e9}, lease);
  EXPECT_EQ(lease.program().threads(), 3);
  EXPECT_FALSE(lease.program().limits().has_memory()) << "its own limits are the campaign's to say";
  campaign.resources = {.memory = 1e9};
  SetResources(campaign, {.threads = 3, .memory = 2e9}, lease);
  EXPECT_EQ(lease.program().limits().memory(), 1e9);
  lease.mutable_program()->mutable_limits()->set_memory(5e8);
  SetResources(campaign, {.threads = 3, .memory = 2e9}, lease);
  EXPECT_EQ(lease.program().limits().memory(), 5e8);
  EXPECT_FALSE(lease.has_limits());
}

TEST(SpecDigest, NamesMaterialsAndMixtures) {
  dem::Scenario scenario;
  scenario.model.contact = "linear";
  const campaign::PackingFile file{.path = "p.txt", .digest = "abc", .packing = {}};
  const auto digest = [&] { return SpecDigest(ToSpec(scenario, file, "tx")); };
  std::set<std::string> seen = {digest()};
  scenario.materials.seed = 5;  // of no mixture
  EXPECT_EQ(digest(), *seen.begin());
  scenario.model.materials = {"steel", "wood"};
  EXPECT_TRUE(seen.insert(digest()).second);
  scenario.materials.bodies = {{"walls", "steel"}};
  EXPECT_TRUE(seen.insert(digest()).second);
  scenario.materials.bodies = {{"walls", "wood"}};
  EXPECT_TRUE(seen.insert(digest()).second);
  scenario.materials.grains = {{"wood", 0.25}};
  EXPECT_TRUE(seen.insert(digest()).second);
  scenario.materials.grains = {{"wood", 0.3}};
  EXPECT_TRUE(seen.insert(digest()).second);
  scenario.materials.seed = 6;
  EXPECT_TRUE(seen.insert(digest()).second);
}

TEST(SpecDigest, NamesGradingAndShapeOfARecipe) {
  const auto digest = [](const dem::PackingRecipe& recipe) {
    return SpecDigest(ToSpec(dem::Scenario{}, recipe, "tx"));
  };
  const dem::Grading grading = {{1e-3, 0}, {2e-3, 1}};
  const dem::Grading finer = {{1e-3, 0}, {1.5e-3, 0.4}, {2e-3, 1}};
  const std::set<std::string> digests = {digest({}), digest({.depth_ratio = 1.1}),
                                         digest({.depth_ratio = 1.2}), digest({.grading = grading}),
                                         digest({.grading = finer})};
  EXPECT_EQ(digests.size(), 5U);
  // A cell as deep as wide is what specs said before they spoke of it: their runs are found again.
  EXPECT_FALSE(ToSpec(dem::Scenario{}, dem::PackingRecipe{}, "tx").recipe().has_depth_ratio());
  EXPECT_TRUE(ToSpec(dem::Scenario{}, dem::PackingRecipe{.depth_ratio = 2}, "tx")
                  .recipe()
                  .has_depth_ratio());
}

TEST(ToSpec, ARealizationBeyondTheFilesNamesTheFileOfItsSizes) {
  const campaign::PackingLike like{
      .path = "p.txt", .digest = "abc", .recipe = {.particles = 70, .porosity = 0.41, .seed = 8}};
  const v1::AttemptSpec spec = ToSpec(dem::Scenario{}, like, "tx");
  EXPECT_EQ(spec.recipe().sizes_digest(), "abc");
  EXPECT_EQ(spec.recipe().particles(), 70);
  EXPECT_EQ(spec.recipe().porosity(), 0.41);
  EXPECT_EQ(spec.recipe().seed(), 8U);
  EXPECT_NE(SpecDigest(spec), SpecDigest(ToSpec(dem::Scenario{}, like.recipe, "tx")));
}

TEST(SpecDigest, DoesNotDependOnTheOrderInWhichMapsWereFilled) {
  v1::AttemptSpec forward;
  v1::AttemptSpec backward;
  for (int i = 0; i < 50; ++i) {
    (*forward.mutable_parameters())["p" + std::to_string(i)] = i;
    (*backward.mutable_parameters())["p" + std::to_string(49 - i)] = 49 - i;
  }
  EXPECT_EQ(SpecDigest(forward), SpecDigest(backward));
}

}  // namespace
}  // namespace calib::messages
