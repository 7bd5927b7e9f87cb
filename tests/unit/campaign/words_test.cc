#include "server/campaign/model/words.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace calib::campaign {
namespace {

// Two values of one word, or two words of one value, would not come back as they went.
template <typename Enum, std::size_t N>
void ExpectOneWordEach(const WordTable<Enum, N>& table) {
  std::set<Enum> values;
  for (const Word<Enum>& word : table) {
    EXPECT_EQ(WordOf(table, word.value), std::string(word.text));
    EXPECT_EQ(ValueOf(table, word.text), word.value) << word.text;
    values.insert(word.value);
  }
  EXPECT_EQ(values.size(), N);
  EXPECT_FALSE(ValueOf(table, "sleeping").has_value());
  EXPECT_EQ(AllWords(table).size(), N);
}

TEST(Words, EachIsItsOwnInverse) {
  ExpectOneWordEach(kShearUnloadingWords);
  ExpectOneWordEach(kRoleWords);
  ExpectOneWordEach(kCampaignStateWords);
  ExpectOneWordEach(kPhaseWords);
  ExpectOneWordEach(kEvaluationStatusWords);
  ExpectOneWordEach(kSamplePurposeWords);
  ExpectOneWordEach(kDerivedForWords);
  ExpectOneWordEach(kPosteriorSourceWords);
  ExpectOneWordEach(kScatterSourceWords);
}

TEST(Words, ThoseOfStoresAndMessagesStayAsTheyAre) {
  EXPECT_STREQ(ToString(CampaignState::kCancelled), "cancelled");
  EXPECT_STREQ(ToString(Phase::kValidating), "validating");
  EXPECT_STREQ(ToString(EvaluationStatus::kStoppedEarly), "stopped_early");
  EXPECT_STREQ(ToString(SamplePurpose::kEnsemble), "");
  EXPECT_EQ(ToCampaignState("paused"), CampaignState::kPaused);
}

}  // namespace
}  // namespace calib::campaign
