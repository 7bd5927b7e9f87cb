#include "server/report/views/stored_diagnosis.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace calib::report {
namespace {

TEST(StoredDiagnosis, TheLatestThatTriedEffectsIsShown) {
  const auto make = [](const char* verdict, bool only_adequacy, const char* next) {
    StoredDiagnosis d;
    d.campaign = "c1";
    d.verdict = verdict;
    d.only_adequacy = only_adequacy;
    d.next_experiment = next;
    return d;
  };
  std::vector<StoredDiagnosis> kept = {make("unexplained", true, "")};
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[0]);
  EXPECT_EQ(LatestOf(kept, "c2"), nullptr);
  kept.push_back(make("missing_effect", false, "- name: next"));
  kept.push_back(make("missing_effect", false, ""));
  kept.push_back(make("unexplained", true, ""));
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[1]);
  kept.push_back(make("ambiguous", false, ""));
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[4]);
  kept.push_back(make("ambiguous", false, "- name: next"));
  kept.push_back(make("ambiguous", false, ""));
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[5]);
  kept.back().then_file = "next.csv";
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[6]) << "it knows another measurement";
}

TEST(StoredDiagnosis, AnotherDocumentIsRefused) {
  for (const char* text : {"", "{", "[]", "{}", R"({"campaign": 3, "verdict": "adequate"})"}) {
    EXPECT_FALSE(ReadDiagnosis(text).ok()) << text;
  }
}

TEST(StoredDiagnosis, ReadsWhatIsThereAndNothingElse) {
  const auto garbled = ReadDiagnosis(R"json({"campaign": "c1", "verdict": "ambiguous",
    "log_evidences": [{"effects": "a", "log_evidence": 1, "log_evidence_se": 0}, 3, {"log_evidence": 2},
                      {"effects": ["b", 4], "log_evidence": "0.2", "log_evidence_se": 0.1}],
    "adequacy": {"chi2": "many"}, "then": [], "next_experiment": null})json");
  ASSERT_TRUE(garbled.ok()) << garbled.status();
  ASSERT_EQ(garbled->evidences.size(), 1U) << "a number is a number";
  EXPECT_TRUE(garbled->evidences[0].effects.empty());
  EXPECT_EQ(garbled->chi2, 0);
  EXPECT_EQ(garbled->then_file, "");
  EXPECT_EQ(garbled->next_experiment, "");
}

}  // namespace
}  // namespace calib::report
