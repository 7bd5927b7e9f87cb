#include "server/page/question.h"

#include <gtest/gtest.h>

#include <set>

namespace calib::page {
namespace {

absl::StatusOr<Question> Parse(const std::string& target) {
  return ParseQuestion(ParseTarget("/api/v1/" + target).value());
}

TEST(Question, IsTheDocumentOfItsAddress) {
  EXPECT_EQ(Parse("campaigns")->document, Document::kList);
  EXPECT_EQ(Parse("campaigns?limit=3&after=c2")->limit, 3);
  EXPECT_EQ(Parse("campaigns?limit=3&after=c2")->after, "c2");
  EXPECT_EQ(Parse("campaigns/c1")->document, Document::kShow);
  EXPECT_EQ(Parse("campaigns/c1/compare")->document, Document::kCompare);
  EXPECT_EQ(Parse("campaigns/c1/compare")->campaign, "c1");
  EXPECT_EQ(Parse("campaigns/c1/posterior?iteration=2")->number, 2);
  EXPECT_EQ(Parse("campaigns/c1/posterior")->number, std::nullopt);
  EXPECT_EQ(Parse("campaigns/c1/states/17")->number, 17);
  EXPECT_EQ(Parse("workers")->document, Document::kWorkers);
}

TEST(Question, AtNoAddressIsNotFound) {
  for (const char* target :
       {"", "campaign", "campaigns/c1/nothing", "campaigns/c1/states", "campaigns/c1/states/1/2",
        "campaigns/c1/compare/2", "workers/w1", "campaigns/%ff", "campaigns/C1",
        "campaigns//compare", "campaigns/c1%2F..", "campaigns/%3Cscript%3E"}) {
    EXPECT_TRUE(absl::IsNotFound(Parse(target).status())) << target;
  }
}

TEST(Question, WithANumberThatIsNoneIsRefused) {
  for (const char* target :
       {"campaigns/c1/states/x", "campaigns/c1/states/-1", "campaigns/c1/states/1x",
        "campaigns/c1/states/99999999999999999999", "campaigns/c1/posterior?iteration=",
        "campaigns/c1/posterior?iteration=%3Cscript%3E", "campaigns?limit=1e3"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(Parse(target).status())) << target;
  }
}

TEST(Question, HasAKeyOfItsOwn) {
  std::set<std::string> keys;
  const std::vector<Question> questions = {
      {.document = Document::kList},
      {.document = Document::kList, .limit = 1},
      {.document = Document::kList, .after = "c1"},
      {.document = Document::kShow, .campaign = "c1"},
      {.document = Document::kShow, .campaign = "c1/c2"},
      {.document = Document::kShow, .campaign = "c1", .after = "c2"},
      {.document = Document::kStates, .campaign = "c1", .number = 1},
      {.document = Document::kStates, .campaign = "c1", .number = 2}};
  for (const Question& question : questions) keys.insert(question.Key());
  EXPECT_EQ(keys.size(), questions.size());
}

}  // namespace
}  // namespace calib::page
