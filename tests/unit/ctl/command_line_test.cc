#include "server/ctl/command_line.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb_list.h"

namespace calib::ctl {
namespace {

Parsed Parse(std::vector<const char*> words, const std::vector<Verb>& verbs = AllVerbs()) {
  words.insert(words.begin(), "calibctl");
  return ParseCommandLine(verbs, static_cast<int>(words.size()), words.data());
}

// A verb with an option of each form, which shows what the command line gave it.
struct Probe {
  std::string campaign;
  std::vector<std::string> set;
  std::string output;
  std::optional<std::uint64_t> seed;
};
struct ProbeVerb {
  Probe given;
  Verb verb{.help = {.name = "probe", .description = "p", .example = "probe"},
            .declare =
                [this](OptionList& list) {
                  list.Campaign(given.campaign);
                  list.Texts("--set", given.set, "s");
                  list.Text("-o,--output", given.output, "o");
                  list.Seed(given.seed);
                },
            .run = [](const CommonOptions&) { return kDone; }};
};

TEST(CommandLine, CommonOptionsStandOnEitherSideOfTheVerb) {
  for (const auto& words : {std::vector<const char*>{"--state", "s", "--json", "probe", "c1"},
                            std::vector<const char*>{"probe", "c1", "--json", "--state", "s"}}) {
    ProbeVerb probe;
    const Parsed parsed = Parse(words, {probe.verb});
    ASSERT_TRUE(parsed.command.has_value());
    EXPECT_EQ(parsed.command->common.server.state, "s");
    EXPECT_EQ(probe.given.campaign, "c1");
    EXPECT_TRUE(parsed.command->common.json);
  }
}

TEST(CommandLine, ASettingMayHoldBlanks) {
  const std::vector<const char*> settings = {"a",     "--set", "e=2 GPa", "--set",
                                             "f=0.5", "-o",    "x.csv"};
  std::vector<const char*> words = settings;
  words.insert(words.begin(), "simulate");
  EXPECT_TRUE(Parse(words).command.has_value());
  words.front() = "probe";
  ProbeVerb probe;
  ASSERT_TRUE(Parse(words, {probe.verb}).command.has_value());
  EXPECT_EQ(probe.given.set, (std::vector<std::string>{"e=2 GPa", "f=0.5"}));
  EXPECT_EQ(probe.given.output, "x.csv");
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
  EXPECT_TRUE(Parse({"run", "a.yaml", "--seed", "18446744073709551615"}).command.has_value());
  ProbeVerb probe;
  ASSERT_TRUE(Parse({"probe", "a", "--seed", "18446744073709551615"}, {probe.verb}).command);
  EXPECT_EQ(probe.given.seed, 18446744073709551615U);
  EXPECT_EQ(Parse({"states", "c1", "-1"}).exit_code, kBadInput);
}

TEST(CommandLine, AVerbBeginsWithTheDefaultsOfItsOptions) {
  struct Options {
    int draws = 20;
  };
  static int seen = 0;
  const auto make = [] {
    return MakeVerb<Options>(
        {.name = "draw", .description = "d", .example = "draw"},
        [](OptionList& list, Options& options) {
          list.BoundedNumber("--draws", options.draws, {2, 400}, "n");
        },
        [](const CommonOptions&, const Options& options) -> absl::StatusOr<int> {
          seen = options.draws;
          return kDone;
        });
  };
  EXPECT_EQ(Parse({"draw", "--draws", "401"}, {make()}).exit_code, kBadInput);
  const std::vector<std::pair<std::vector<const char*>, int>> cases = {
      {{"draw"}, 20}, {{"draw", "--draws", "7"}, 7}};
  for (const auto& [words, draws] : cases) {
    const Parsed parsed = Parse(words, {make()});
    ASSERT_TRUE(parsed.command.has_value());
    EXPECT_EQ(parsed.command->verb.run(parsed.command->common).value(), kDone);
    EXPECT_EQ(seen, draws);
  }
}

TEST(CommandLine, EveryVerbIsThereOnceAndShowsHelp) {
  std::vector<std::string> names;
  for (const Verb& verb : AllVerbs()) {
    names.push_back(verb.help.name);
    ::testing::internal::CaptureStdout();
    EXPECT_EQ(Parse({verb.help.name.c_str(), "--help"}).exit_code, kDone);
    EXPECT_NE(::testing::internal::GetCapturedStdout().find("calibctl " + verb.help.example),
              std::string::npos);
  }
  const std::filesystem::directory_iterator files(CALIB_VERBS);
  EXPECT_EQ(static_cast<std::ptrdiff_t>(names.size()), std::distance(begin(files), end(files)));
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
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
