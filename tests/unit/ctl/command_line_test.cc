#include "server/ctl/command_line.h"

#include <gtest/gtest.h>

#include "server/ctl/exit_codes.h"

namespace calib::ctl {
namespace {

Parsed Parse(std::vector<const char*> words) {
  words.insert(words.begin(), "calibctl");
  return ParseCommandLine(static_cast<int>(words.size()), words.data());
}

TEST(CommandLine, CommonOptionsStandOnEitherSideOfTheVerb) {
  for (const auto& words :
       {std::vector<const char*>{"--state", "s", "--json", "posterior", "c1"},
        std::vector<const char*>{"posterior", "c1", "--json", "--state", "s"}}) {
    const Parsed parsed = Parse(words);
    ASSERT_TRUE(parsed.command.has_value());
    EXPECT_EQ(parsed.command->arguments.server.state, "s");
    EXPECT_EQ(parsed.command->arguments.campaign, "c1");
    EXPECT_TRUE(parsed.command->arguments.json);
  }
}

TEST(CommandLine, ASettingMayHoldBlanks) {
  const Parsed parsed =
      Parse({"simulate", "a.yaml", "--set", "e=2 GPa", "--set", "f=0.5", "-o", "x.csv"});
  ASSERT_TRUE(parsed.command.has_value());
  EXPECT_EQ(parsed.command->arguments.set, (std::vector<std::string>{"e=2 GPa", "f=0.5"}));
  EXPECT_EQ(parsed.command->arguments.output, "x.csv");
}

TEST(CommandLine, AServerIsHostAndPort) {
  EXPECT_TRUE(Parse({"list", "--server", "node1:7443"}).command.has_value());
  for (const char* bad :
       {"", "foo", "127.0.0.1", "127.0.0.1:99999", "http://node1:7443", "127.0.0.1:7543/x"}) {
    EXPECT_EQ(Parse({"list", "--server", bad}).exit_code, kBadInput) << bad;
  }
}

TEST(CommandLine, WhatIsNotUtf8IsRefused) {
  EXPECT_TRUE(Parse({"show", "c\xC3\xA4"}).command.has_value());
  EXPECT_EQ(Parse({"show", "c\xE4"}).exit_code, kBadInput);
  EXPECT_EQ(Parse({"validate", "s\xE4nd.yaml"}).exit_code, kBadInput);
}

TEST(CommandLine, BadUsageIsTwoAndHelpIsZero) {
  EXPECT_EQ(Parse({}).exit_code, kBadInput);
  EXPECT_EQ(Parse({"frobnicate"}).exit_code, kBadInput);
  EXPECT_EQ(Parse({"show"}).exit_code, kBadInput);
  EXPECT_EQ(Parse({"list", "--state", "a", "--server", "b:1"}).exit_code, kBadInput);
  EXPECT_EQ(Parse({"run", "a.yaml", "--workers", "many"}).exit_code, kBadInput);
  EXPECT_EQ(Parse({"--help"}).exit_code, kDone);
  EXPECT_EQ(Parse({"run", "--help"}).exit_code, kDone);
}

TEST(CommandLine, AMistypedVerbIsNamed) {
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(Parse({"--state", "list", "shw", "c1"}).exit_code, kBadInput);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            "calibctl: 'shw' is not a command; did you mean 'show'?\n");
}

TEST(CommandLine, NumbersAreNotWrappedRound) {
  for (const char* seed : {"-1", "99999999999999999999", "", "1e3", "0x1"}) {
    EXPECT_EQ(Parse({"run", "a.yaml", "--seed", seed}).exit_code, kBadInput) << seed;
  }
  const Parsed parsed = Parse({"run", "a.yaml", "--seed", "18446744073709551615"});
  ASSERT_TRUE(parsed.command.has_value());
  EXPECT_EQ(parsed.command->arguments.seed, 18446744073709551615U);
  EXPECT_EQ(Parse({"states", "c1", "-1"}).exit_code, kBadInput);
}

TEST(CommandLine, VerbsThatSpeakOfErrorsSayWhatTheyAre) {
  for (const char* verb : {"compare", "diagnose", "improve"}) {
    ::testing::internal::CaptureStdout();
    EXPECT_EQ(Parse({verb, "--help"}).exit_code, kDone);
    EXPECT_NE(::testing::internal::GetCapturedStdout().find("Error: root mean square"),
              std::string::npos)
        << verb;
  }
}

}  // namespace
}  // namespace calib::ctl
