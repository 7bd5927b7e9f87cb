#include "server/inspection/campaign_draft.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/campaign_file.h"
#include "server/methods/registry.h"
#include "tests/unit/inspection/tables.h"

namespace calib::inspection {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

InspectedFile FileOf(const std::string& text) {
  return {.file = "d.csv", .inspection = InspectText(text)};
}

std::string KnownText() {
  const KnownTest test = MakeKnownTest();
  std::string text = "eps1[%],epsv[%],q[kPa],p[kPa],e\n";
  for (std::size_t i = 0; i < test.ea.size(); ++i) {
    absl::StrAppend(&text, test.ea[i] * 100, ",", test.ev[i] * 100, ",", test.q[i] / 1e3, ",",
                    test.p[i] / 1e3, ",", test.e[i], "\n");
  }
  return text;
}

campaign::ReadOutcome Read(const std::string& yaml, const std::string& table) {
  return campaign::ReadCampaign(
      methods::All(), yaml, "out.yaml",
      [&table](const std::string&) -> absl::StatusOr<std::string> { return table; });
}

TEST(CampaignDraft, IsAGoodCampaignThatReadsTheSameNumbers) {
  const std::string table = KnownText();
  const auto yaml =
      CampaignDraft({FileOf(table)}, {.test = "triaxial_drained", .campaign_file = "out.yaml"});
  ASSERT_TRUE(yaml.ok()) << yaml.status();
  const campaign::ReadOutcome outcome = Read(*yaml, table);
  ASSERT_TRUE(outcome.problems.empty()) << campaign::ToString(outcome.problems.front()) << *yaml;
  ASSERT_EQ(outcome.campaign.experiments.size(), 1U);
  const campaign::Experiment& experiment = outcome.campaign.experiments.front();
  EXPECT_DOUBLE_EQ(experiment.settings.at("confining_pressure"), 200e3);
  const KnownTest known = MakeKnownTest();
  ASSERT_EQ(experiment.observables.front().name, "deviatoric_stress");
  EXPECT_NEAR(experiment.observables.front().values.back(), known.q.back(), 1);
  // The void ratio says what the volumetric strain does.
  EXPECT_THAT(*yaml, Not(HasSubstr("void_ratio: {noise")));
  EXPECT_THAT(*yaml, HasSubstr("# confirm"));
}

TEST(CampaignDraft, EachTestOfAFileIsAnExperiment) {
  const KnownTest test = MakeKnownTest(12);
  std::string table = "test_id,eps_a[%],q[kPa],sigma_3[kPa]\n";
  for (const char* name : {"A 1", "B#2"}) {
    for (std::size_t i = 0; i < test.ea.size(); ++i) {
      absl::StrAppend(&table, "\"", name, "\",", test.ea[i] * 100, ",", test.q[i] / 1e3, ",200\n");
    }
  }
  const auto yaml =
      CampaignDraft({FileOf(table)}, {.test = "triaxial_drained", .campaign_file = "out.yaml"});
  ASSERT_TRUE(yaml.ok()) << yaml.status();
  const campaign::ReadOutcome outcome = Read(*yaml, table);
  ASSERT_TRUE(outcome.problems.empty()) << campaign::ToString(outcome.problems.front()) << *yaml;
  ASSERT_EQ(outcome.campaign.experiments.size(), 2U);
  EXPECT_EQ(outcome.campaign.experiments[1].control.size(), 12U);
}

// A load frame's file: strain and stress are computed by the campaign as by the inspection.
TEST(CampaignDraft, LoadAndDisplacementBecomeStressAndStrain) {
  const KnownTest test = MakeKnownTest();
  std::string table = "height: 100 mm, diameter: 50 mm\nload [N],displacement [mm]\n";
  for (std::size_t i = 0; i < test.ea.size(); ++i) {
    absl::StrAppend(&table, test.q[i] * 1963.4954e-6 / (1 - test.ea[i]), ",", test.ea[i] * 100,
                    "\n");
  }
  const auto yaml =
      CampaignDraft({FileOf(table)}, {.test = "triaxial_drained", .campaign_file = "out.yaml"});
  ASSERT_TRUE(yaml.ok()) << yaml.status();
  const campaign::ReadOutcome outcome = Read(*yaml, table);
  ASSERT_TRUE(outcome.problems.empty()) << campaign::ToString(outcome.problems.front()) << *yaml;
  const campaign::MeasuredObservable& q = outcome.campaign.experiments.front().observables.front();
  EXPECT_EQ(q.name, "deviatoric_stress");
  EXPECT_NEAR(q.values.back(), test.q.back(), 1e-4 * test.q.back());
}

TEST(CampaignDraft, SaysWhatIsMissing) {
  const auto question = DraftQuestion{.test = "triaxial_drained", .campaign_file = "out.yaml"};
  EXPECT_THAT(CampaignDraft({FileOf("q[kPa],p[kPa]\n0,200\n50,217\n90,230\n")}, question)
                  .status()
                  .message(),
              HasSubstr("axial_strain"));
  EXPECT_THAT(CampaignDraft({FileOf("eps1[%],x\n0,1\n1,2\n2,3\n")}, question).status().message(),
              HasSubstr("nothing that triaxial_drained can be compared by"));
  EXPECT_THAT(CampaignDraft({FileOf(KnownText())}, {.test = "triaxial", .campaign_file = "o.yaml"})
                  .status()
                  .message(),
              HasSubstr("is not a lab test"));
  EXPECT_THAT(
      CampaignDraft({FileOf(KnownText())}, {.test = "silo_discharge", .campaign_file = "o.yaml"})
          .status()
          .message(),
      HasSubstr("for tests of a specimen"));
}

}  // namespace
}  // namespace calib::inspection
