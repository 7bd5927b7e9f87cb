// The page of a diagnosis by probabilities.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "server/report/html/report.h"
#include "server/report/views/stored_diagnosis.h"
#include "tests/unit/report/example_diagnosis.h"
#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(EffectsSection, ShowsModelsFamiliesAndWhatEachEffectWouldChange) {
  const CampaignView view = testing::ExampleView("sand");
  auto diagnosis = ReadDiagnosis(testing::ExampleDiagnosis(view));
  ASSERT_TRUE(diagnosis.ok()) << diagnosis.status();
  Story story;
  story.known = true;
  story.diagnoses = {*diagnosis};
  const std::string html = RenderReport(view, story);
  for (const char* said :
       {"One of these two, 97 %", "<strong>contact plasticity</strong></td><td class=\"l\"><span",
        "style=\"width:98px\"></span> 61 %</td><td>yes</td>", "the model as it is",
        "contact plasticity + membrane", "none of these", "all others together",
        "<li>contact plasticity, twisting resistance: 97.4 %</li>", "<td>2.4 → 1.07</td>",
        "second specimen would name one effect with probability 80 %",
        "<h4>contact plasticity, 61.4 %; error 2.4 → 1.07 sd; like twisting resistance in these "
        "tests</h4>",
        "<figcaption>tx02: volumetric strain</figcaption>", "&lt;b&gt;membrane"}) {
    EXPECT_THAT(html, HasSubstr(said));
  }
  EXPECT_THAT(html, Not(HasSubstr("p (screen)")));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(EffectsSection, ReadsWhatIsThereAndNothingElse) {
  const auto garbled = ReadDiagnosis(R"json({"campaign": "c1", "verdict": "ambiguous",
    "probabilities": [{"effects": "a", "probability": 0.5}, 3, {"probability": 1},
                      {"effects": ["b", 4], "probability": "0.2"}],
    "families": {}, "credible_set": [["b"], 7], "specimens": 3,
    "candidates": [{"effect": "b", "curves": [{"experiment": "e", "change": [1, null]}, {}]}]})json");
  ASSERT_TRUE(garbled.ok()) << garbled.status();
  ASSERT_EQ(garbled->probabilities.size(), 2U);
  EXPECT_TRUE(garbled->probabilities[0].effects.empty());
  EXPECT_EQ(garbled->probabilities[1].effects, std::vector<std::string>{"b"});
  EXPECT_EQ(garbled->probabilities[1].probability, 0);
  EXPECT_EQ(garbled->credible_set.size(), 2U);
  ASSERT_EQ(garbled->candidates[0].curves.size(), 1U);
  EXPECT_EQ(garbled->candidates[0].curves[0].change.size(), 2U);
  EXPECT_TRUE(std::isnan(garbled->candidates[0].curves[0].change[1]));
  EXPECT_FALSE(garbled->candidates[0].probability.has_value());
}

}  // namespace
}  // namespace calib::report
