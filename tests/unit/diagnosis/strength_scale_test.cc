#include "server/diagnosis/strength_scale.h"

#include <gtest/gtest.h>

#include <cmath>

namespace calib::diagnosis {
namespace {

using inference::Prior;
using inference::PriorKind;

campaign::Campaign With(const std::string& contact, const std::string& effect,
                        const std::string& parameter, const Prior& prior) {
  campaign::Campaign campaign;
  campaign.model.contact = contact;
  campaign.model.effects = {effect};
  campaign.parameters.push_back(
      {.name = "young_modulus",
       .unit = "Pa",
       .prior = {.kind = PriorKind::kLogUniform, .min = 1e8, .max = 1e10}});
  campaign.parameters.push_back({.name = effect + "." + parameter, .unit = "1", .prior = prior});
  return campaign;
}

Prior StrengthOf(const campaign::Campaign& campaign) { return campaign.parameters.back().prior; }

TEST(StrengthScale, WidensTheDistanceFromTheNullAndNothingElse) {
  const auto base = With("hertz_mindlin", "contact_plasticity", "stiffness_ratio",
                         {.kind = PriorKind::kUniform, .min = 1, .max = 5});
  const auto* ratio =
      dem::FindParameter("hertz_mindlin", base.model.effects, "contact_plasticity.stiffness_ratio");
  ASSERT_NE(ratio, nullptr);
  ASSERT_EQ(ratio->null_value, 1);
  const auto wide = WithStrengthScaled(base, "contact_plasticity", 2);
  EXPECT_DOUBLE_EQ(StrengthOf(wide).min, 1);
  EXPECT_DOUBLE_EQ(StrengthOf(wide).max, 9);
  EXPECT_DOUBLE_EQ(wide.parameters[0].prior.max, 1e10);
  const auto narrow = WithStrengthScaled(base, "contact_plasticity", 0.25);
  EXPECT_DOUBLE_EQ(StrengthOf(narrow).max, 2);
}

TEST(StrengthScale, MovesBothEndsOfALogPriorWithNullZero) {
  const auto base = With("hertz_mindlin", "rolling_resistance", "stiffness_ratio",
                         {.kind = PriorKind::kLogUniform, .min = 0.01, .max = 1});
  const auto scaled = WithStrengthScaled(base, "rolling_resistance", 0.25);
  EXPECT_DOUBLE_EQ(StrengthOf(scaled).min, 0.0025);
  EXPECT_DOUBLE_EQ(StrengthOf(scaled).max, 0.25);
}

TEST(StrengthScale, StaysInsideWhatIsAdmissible) {
  const auto base = With("hertz_mindlin", "hertz_nonlinearity", "exponent",
                         {.kind = PriorKind::kUniform, .min = 1, .max = 2.5});
  const auto* exponent =
      dem::FindParameter("hertz_mindlin", base.model.effects, "hertz_nonlinearity.exponent");
  ASSERT_NE(exponent, nullptr);
  const Prior wide = StrengthOf(WithStrengthScaled(base, "hertz_nonlinearity", 4));
  EXPECT_GE(wide.min, exponent->min);
  EXPECT_LE(wide.max, exponent->max);
  EXPECT_GT(wide.max, 2.5);
}

TEST(StrengthScale, NormalPriorsKeepTheirShape) {
  const auto base = With("hertz_mindlin", "load_cell_error", "gain",
                         {.kind = PriorKind::kNormal, .mean = 0.02, .sd = 0.01});
  const auto scaled = WithStrengthScaled(base, "load_cell_error", 4);
  const auto* info =
      dem::FindParameter("hertz_mindlin", base.model.effects, "load_cell_error.gain");
  ASSERT_NE(info, nullptr);
  const double null = info->null_value.value_or(std::nan(""));
  EXPECT_DOUBLE_EQ(StrengthOf(scaled).mean, null + 4 * (0.02 - null));
  EXPECT_DOUBLE_EQ(StrengthOf(scaled).sd, 0.04);
}

TEST(StrengthScale, LeavesACampaignWithoutTheEffectAlone) {
  const auto base = With("hertz_mindlin", "rolling_resistance", "friction",
                         {.kind = PriorKind::kUniform, .min = 0, .max = 1});
  EXPECT_DOUBLE_EQ(StrengthOf(WithStrengthScaled(base, "adhesion_jkr", 4)).max, 1);
  EXPECT_DOUBLE_EQ(StrengthOf(WithStrengthScaled(base, "no_such_effect", 4)).max, 1);
}

}  // namespace
}  // namespace calib::diagnosis
