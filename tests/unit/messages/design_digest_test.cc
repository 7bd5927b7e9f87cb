// Equal runs of a base, its design and its extensions are recognised by their digests.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "dem/registry/catalog.h"
#include "server/campaign/file/campaign_file.h"
#include "server/campaign/file/derive.h"
#include "server/campaign/model/race.h"
#include "server/messages/attempt_spec.h"
#include "server/methods/registry.h"
#include "tests/support/small_campaign.h"

namespace calib::messages {
namespace {

constexpr const char* kContact = "hertz_mindlin";
constexpr dem::ReferenceState kState = {.pressure = 1e5, .diameter = 2e-3, .modulus = 2e8};
constexpr int kStream = 3;

using Values = std::map<std::string, double>;

// What an effect is calibrated by, at the nearer step of each of its rays.
Values StrengthOf(const dem::EffectInfo& effect) {
  Values values;
  for (const dem::StrengthRay& ray : effect.rays) {
    values.merge(dem::ParametersOnRay(effect, ray, ray.steps[0], kContact, kState));
  }
  return values;
}

// Priors that hold a strength and leave out its null.
std::map<std::string, dem::DefaultPrior> PriorsAbout(const dem::EffectInfo& effect) {
  std::map<std::string, dem::DefaultPrior> priors;
  for (const dem::ParameterInfo& info : effect.parameters) {
    const Values strength = StrengthOf(effect);
    const auto value = strength.find(effect.name + "." + info.name);
    if (value == strength.end()) continue;
    const double null = dem::NullValueOf(info, kContact).value_or(0);
    const double half = 0.5 * (value->second - null);
    priors[value->first] = {.kind = "uniform",
                            .min = value->second - half,
                            .max = std::min(info.max, value->second + half)};
  }
  return priors;
}

bool CanJoin(const dem::EffectInfo& effect) {
  return effect.contacts.empty() || std::find(effect.contacts.begin(), effect.contacts.end(),
                                              kContact) != effect.contacts.end();
}

class DesignDigest : public ::testing::Test {
 protected:
  campaign::Campaign Read(const std::string& yaml) const {
    const auto files = small_.files;
    campaign::ReadOutcome outcome =
        campaign::ReadCampaign(methods::All(), yaml, "c.yaml",
                               [&files](const std::string& path) -> absl::StatusOr<std::string> {
                                 return files.at(path);
                               });
    EXPECT_TRUE(outcome.problems.empty()) << campaign::ToString(outcome.problems.front()) << "\n"
                                          << yaml;
    return std::move(outcome.campaign);
  }

  campaign::Campaign Derived(const campaign::Derivation& derivation) const {
    const auto text = campaign::Derive(methods::All(), small_.yaml, derivation);
    EXPECT_TRUE(text.ok()) << text.status();
    return Read(*text);
  }

  // Of the values by name, the others at their null or, without one, anything finite.
  static std::vector<double> Row(const campaign::Campaign& campaign, Values values) {
    values["young_modulus"] = 2e8;
    values["friction_angle"] = 0.5;
    std::vector<double> row;
    for (const campaign::CalibratedParameter& parameter : campaign.parameters) {
      const auto value = values.find(parameter.name);
      const double absent = campaign::NullOf(campaign, parameter.name).value_or(0.25);
      row.push_back(value != values.end() ? value->second : absent);
    }
    return row;
  }

  static std::string DigestOf(const campaign::Campaign& campaign, const Values& values) {
    return SpecDigest(SpecOf(campaign, 0, {Row(campaign, values), kStream}));
  }

  const testing::SmallCampaign small_ = testing::MakeSmallCampaign({.packings = 2});
};

TEST_F(DesignDigest, OfEveryEffectIsThatOfTheBaseAtTheNullAndOfAnExtensionOnItsRay) {
  campaign::Derivation design{.name = "race",
                              .lineage = {.parent = "c1", .purpose = "design"},
                              .first_proposal = std::nullopt,
                              .race = std::vector<std::string>{}};
  for (const dem::EffectInfo& effect : dem::Effects()) {
    if (!CanJoin(effect)) continue;
    design.race->push_back(effect.name);
    design.parameters.merge(PriorsAbout(effect));
  }
  ASSERT_GT(design.race->size(), 10U);
  const campaign::Campaign racing = Derived(design);
  const std::string base = DigestOf(Read(small_.yaml), {});
  EXPECT_EQ(DigestOf(racing, {}), base);
  EXPECT_EQ(campaign::WhyNotRun(racing, Row(racing, {})), "") << "the nulls lie outside the priors";
  for (const std::string& name : *design.race) {
    SCOPED_TRACE(name);
    const dem::EffectInfo& effect = *dem::FindEffect(name);
    const campaign::Campaign extension =
        Derived({.name = "extension",
                 .lineage = {.parent = "c1", .purpose = "extension"},
                 .effects = {name},
                 .parameters = PriorsAbout(effect),
                 .first_proposal = std::nullopt});
    const std::string with = DigestOf(racing, StrengthOf(effect));
    EXPECT_EQ(with, DigestOf(extension, StrengthOf(effect)));
    EXPECT_NE(with, base);
    EXPECT_EQ(campaign::WhyNotRun(racing, Row(racing, StrengthOf(effect))), "");
  }
}

TEST_F(DesignDigest, OfOtherNumericsIsThatOfACampaignWithThem) {
  const campaign::Campaign design =
      Derived({.name = "numerics",
               .lineage = {.parent = "c1", .purpose = "design"},
               .parameters = {{"numerics.rate", {.kind = "uniform", .min = 1, .max = 3}},
                              {"numerics.damping", {.kind = "uniform", .min = 1, .max = 3}}},
               .first_proposal = std::nullopt,
               .race = std::vector<std::string>{}});
  EXPECT_EQ(DigestOf(design, {}), DigestOf(Read(small_.yaml), {}));
  std::string yaml = small_.yaml;
  for (const auto& [old, now] : std::map<std::string, std::string>{
           {"rate: 5 1/s", "rate: 10 1/s"}, {"damping: [0.4, 0.9]", "damping: [0.8, 0.9]"}}) {
    ASSERT_NE(yaml.find(old), std::string::npos) << yaml;
    yaml.replace(yaml.find(old), old.size(), now);
  }
  const campaign::Campaign other = Read(yaml);
  EXPECT_EQ(DigestOf(design, {{"numerics.rate", 2}, {"numerics.damping", 2}}), DigestOf(other, {}));
}

}  // namespace
}  // namespace calib::messages
