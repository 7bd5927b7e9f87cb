#include "server/ctl/assignments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace calib::ctl {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

campaign::Campaign Model() {
  campaign::Campaign c;
  c.model.contact = "hertz_mindlin";
  c.model.parameters = {{"poisson_ratio", 0.2}};
  c.parameters = {{"young_modulus", "Pa", {}}, {"friction_coefficient", "1", {}}};
  return c;
}

std::string Error(const std::vector<std::string>& set) {
  campaign::Campaign c = Model();
  return std::string(ApplyAssignments(set, c).status().message());
}

TEST(Assignments, TakeUnitsAndFixedParameters) {
  campaign::Campaign c = Model();
  const auto values =
      ApplyAssignments({"friction_coefficient=0.5", "young_modulus=2 GPa", "poisson_ratio=0.3"}, c);
  ASSERT_TRUE(values.ok()) << values.status();
  EXPECT_THAT(*values, ElementsAre(2e9, 0.5));
  EXPECT_DOUBLE_EQ(c.model.parameters.at("poisson_ratio"), 0.3);
}

TEST(Assignments, LabelsHaveTheCommonValueUnlessTheirScoresAreGiven) {
  campaign::Campaign c = Model();
  const inference::Prior half{.kind = inference::PriorKind::kNormal, .min = 0};
  const inference::Prior normal{.kind = inference::PriorKind::kNormal};
  c.parameters.push_back(
      {.name = "friction_coefficient.spread", .unit = "1", .prior = half, .of_population = true});
  c.parameters.push_back({.name = "friction_coefficient@A.score",
                          .unit = "1",
                          .prior = normal,
                          .nuisance = true,
                          .of_population = true});
  const std::vector<std::string> common = {"friction_coefficient=0.5", "young_modulus=2 GPa"};
  EXPECT_THAT(ApplyAssignments(common, c).value(), ElementsAre(2e9, 0.5, 0, 0));
  std::vector<std::string> set = common;
  set.emplace_back("friction_coefficient.spread=0.1");
  set.emplace_back("friction_coefficient@A.score=-2");
  EXPECT_THAT(ApplyAssignments(set, c).value(), ElementsAre(2e9, 0.5, 0.1, -2));
  set[2] = "friction_coefficient.spread=-0.1";
  EXPECT_THAT(std::string(ApplyAssignments(set, c).status().message()),
              HasSubstr("outside what is allowed"));
}

TEST(Assignments, EveryMistakeHasItsLine) {
  EXPECT_EQ(Error({"friction_coefficient=0.5"}),
            "young_modulus is calibrated in this campaign and needs a value: --set "
            "young_modulus=VALUE[ Pa]");
  EXPECT_THAT(Error({"young_modulus=2 deg", "friction_coefficient=0.5"}),
              HasSubstr("--set young_modulus: deg is an angle"));
  EXPECT_THAT(Error({"young_moduls=2"}), HasSubstr("did you mean 'young_modulus'?"));
  EXPECT_THAT(Error({"young_modulus"}), HasSubstr("is not NAME=VALUE"));
  EXPECT_THAT(Error({"poisson_ratio=0.9"}), HasSubstr("outside what is allowed"));
  for (const char* refused :
       {"friction_coefficient=-1", "friction_coefficient=0.3 m", "friction_coefficient=nan"}) {
    const std::string error = Error({"young_modulus=1e9", refused});
    EXPECT_THAT(error, HasSubstr("--set friction_coefficient: ")) << refused;
    EXPECT_THAT(error, Not(HasSubstr("needs a value"))) << refused;
  }
  EXPECT_THAT(Error({"young_modulus=1e9", "young_modulus=2e9"}), HasSubstr("is given twice"));
}

}  // namespace
}  // namespace calib::ctl
