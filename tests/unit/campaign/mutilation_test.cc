// Random damage to a good campaign and its files: whatever comes out is a campaign or a list of
// problems, never a crash.
#include <gtest/gtest.h>

#include <random>

#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using testing::GoodFiles;
using testing::GoodYaml;
using testing::ReaderOf;

class Mutilator {
 public:
  explicit Mutilator(std::uint32_t seed) : random_(seed) {}

  std::string Damage(std::string text) {
    const int cuts = 1 + static_cast<int>(random_() % 4);
    for (int i = 0; i < cuts && !text.empty(); ++i) Once(text);
    return text;
  }

 private:
  void Once(std::string& text) {
    static const std::string kInserted[] = {
        "{",  "}",  "[",     "]",   ":",   "- ",   "\n",   "  ",    "#",    "\"", "&a ",
        "*a", "!x", "1e999", "nan", "inf", "-1",   "0",    "~",     "null", "\t", ",",
        "%",  "|",  ">",     "'",   "@",   "\x01", "\xff", "---\n", "? "};
    const std::size_t at = random_() % text.size();
    switch (random_() % 4) {
      case 0:
        text.erase(at, 1 + random_() % 20);
        break;
      case 1:
        text.insert(at, kInserted[random_() % std::size(kInserted)]);
        break;
      case 2:
        text[at] = static_cast<char>(random_());
        break;
      default:
        text.insert(at, text.substr(random_() % text.size(), random_() % 30));
        break;
    }
  }

  std::mt19937 random_;
};

void ExpectOneLineEach(const ReadOutcome& outcome) {
  for (const Problem& problem : outcome.problems) {
    EXPECT_EQ(ToString(problem).find('\n'), std::string::npos) << ToString(problem);
    EXPECT_FALSE(problem.message.empty());
    EXPECT_GE(problem.line, 0);
  }
}

TEST(Mutilation, DamagedCampaignFilesNeverCrash) {
  int good = 0;
  for (std::uint32_t seed = 0; seed < 3000; ++seed) {
    Mutilator mutilator(seed);
    const ReadOutcome outcome =
        ReadCampaign(methods::All(), mutilator.Damage(GoodYaml()), "c.yaml", ReaderOf(GoodFiles()));
    ExpectOneLineEach(outcome);
    good += outcome.problems.empty() ? 1 : 0;
  }
  EXPECT_LT(good, 1500);  // most damage is noticed
}

TEST(Mutilation, DamagedDataAndPackingsNeverCrash) {
  for (std::uint32_t seed = 0; seed < 1000; ++seed) {
    Mutilator mutilator(seed);
    auto files = GoodFiles();
    for (auto& [path, content] : files) content = mutilator.Damage(content);
    ExpectOneLineEach(ReadCampaign(methods::All(), GoodYaml(), "c.yaml", ReaderOf(files)));
  }
}

TEST(Mutilation, SmallTextsThatExplode) {
  std::string laughs = "a: &a [x, x, x, x, x, x, x, x, x]\n";
  for (char c = 'b'; c < 'l'; ++c) {
    const std::string before(1, static_cast<char>(c - 1));
    laughs += std::string(1, c) + ": &" + c + " [";
    for (int i = 0; i < 9; ++i) laughs += (i == 0 ? "*" : ", *") + before;
    laughs += "]\n";
  }
  EXPECT_FALSE(ReadCampaign(methods::All(), laughs, "c.yaml", ReaderOf({})).problems.empty());
  EXPECT_FALSE(ReadCampaign(methods::All(), "a: &a [*a]", "c.yaml", ReaderOf({})).problems.empty());
  EXPECT_FALSE(ReadCampaign(methods::All(), std::string(100000, '['), "c.yaml", ReaderOf({}))
                   .problems.empty());
  EXPECT_FALSE(ReadCampaign(methods::All(), "", "c.yaml", ReaderOf({})).problems.empty());
}

TEST(Mutilation, WhatIsNestedTooDeeplyIsSaidAndARuledCommentIsNot) {
  const auto problem = [](const std::string& text) {
    const auto problems = ReadCampaign(methods::All(), text, "c.yaml", ReaderOf({})).problems;
    return problems.empty() ? "" : problems.front().message;
  };
  const std::string deep = "is nested too deeply or too large for a campaign file";
  std::string lists;
  for (int k = 0; k < 60; ++k) lists += "- ";
  EXPECT_EQ(problem("name: x\n" + lists + "x\n"), deep);
  EXPECT_EQ(problem(std::string(60, '{') + "\n"), deep);
  EXPECT_EQ(problem(std::string(300'000, '\n')), deep);
  const std::string ruled = "# " + std::string(100, '-') + " priors " + lists + "\n";
  EXPECT_TRUE(ReadCampaign(methods::All(), ruled + GoodYaml(), "c.yaml", ReaderOf(GoodFiles()))
                  .problems.empty());
}

}  // namespace
}  // namespace calib::campaign
