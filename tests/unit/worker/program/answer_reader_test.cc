#include "worker/program/answer_reader.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

namespace calib::worker {
namespace {

Asked TwoObservables(int load_steps = 3) {
  return {.observables = {"p", "q"}, .load_steps = load_steps, .run = "7"};
}

AnswerReader Heard(const std::string& text, const Asked& asked = TwoObservables()) {
  AnswerReader reader(asked);
  reader.Add(text);
  return reader;
}

std::string Shown(const std::vector<v1::State>& states) {
  std::string shown;
  for (const v1::State& state : states) {
    shown += state.ShortDebugString() + "\n";
  }
  return shown;
}

/// Why the answer failed; "" where it did not.
std::string FailureOf(const std::string& text, const Asked& asked = TwoObservables()) {
  const auto end = Heard(text, asked).end();
  return end.has_value() && end->kind == AnswerEnd::Kind::kFailed ? end->reason : "";
}

TEST(AnswerReader, StatesInTheOrderThatWasAsked) {
  AnswerReader reader =
      Heard("{\"load_step\": 0, \"q\": 1, \"p\": 2}\n{\"p\":3,\"q\":4,\"load_step\":1.0}\n");
  const auto states = reader.TakeStates();
  ASSERT_EQ(states.size(), 2U);
  EXPECT_EQ(states[0].values(0), 2);
  EXPECT_EQ(states[0].values(1), 1);
  EXPECT_EQ(states[1].load_step(), 1);
  EXPECT_EQ(reader.states().reached(), 2);
  EXPECT_FALSE(reader.states().complete());
  reader.Add("{\"load_step\": 2, \"q\": 1, \"p\": 2}\n");
  EXPECT_TRUE(reader.states().complete());
  EXPECT_FALSE(reader.end().has_value()) << "of a program that does not stay the end is its end";
}

TEST(AnswerReader, SeveralLinesOfOneStepAddUp) {
  AnswerReader reader = Heard("{\"load_step\": 0, \"q\": 1}\n");
  EXPECT_TRUE(reader.TakeStates().empty());
  reader.Add("{\"load_step\": 0, \"extra\": 5, \"p\": 2, \"q\": 1}\n");
  const auto states = reader.TakeStates();
  ASSERT_EQ(states.size(), 1U);
  EXPECT_EQ(states[0].values_size(), 2);
  EXPECT_EQ(states[0].others().at("extra"), 5);
}

TEST(AnswerReader, WhatComesAfterAStateJoinsIt) {
  AnswerReader reader = Heard("{\"load_step\": 0, \"q\": 1, \"p\": 2}\n");
  reader.TakeStates();
  reader.Add("{\"load_step\": 0, \"more\": 5}\n{\"load_step\": 0, \"more\": 6}\n");
  const auto states = reader.TakeStates();
  ASSERT_EQ(states.size(), 1U) << "what is said again is not sent again";
  EXPECT_EQ(states[0].values_size(), 0);
  EXPECT_EQ(states[0].others().at("more"), 5);
}

TEST(AnswerReader, OthersAreWhatAMessageHolds) {
  std::string line =
      "{\"load_step\": 0, \"q\": 1, \"p\": 2, \"\": 1, \"a\\nb\": 1, \"n\": NaN, "
      "\"t\": \"x\", \"b\": true, \"run\": \"5\", \"in\": [1], \"" +
      std::string(300, 'x') + "\": 1";
  for (int k = 0; k < 300; ++k) line += ", \"k" + std::to_string(k) + "\": 1";
  const auto states = Heard(line + "}\n").TakeStates();
  ASSERT_EQ(states.size(), 1U);
  EXPECT_EQ(states[0].others_size(), 256);
  EXPECT_FALSE(states[0].others().contains("n"));
  EXPECT_FALSE(states[0].others().contains("a\nb"));
}

TEST(AnswerReader, PiecesOfAnySizeAndCrLf) {
  const std::string text =
      "hello\r\n{\"load_step\": 0, \"p\": 0.1, \"q\": -2e-300}\r\n\r\n"
      "{\"load_step\": 1, \"p\": 1, \"q\": 2}\n\n  {not an answer\n{\"load_step\": 2, \"p\": 1, "
      "\"q\": 2}";
  AnswerReader whole = Heard(text);
  whole.EndOfInput();
  const std::string expected = Shown(whole.TakeStates());
  EXPECT_TRUE(whole.states().complete()) << "a last line may have no end";
  EXPECT_EQ(whole.ignored_lines(), 4);
  EXPECT_EQ(whole.ignored_samples()[0], "hello");
  std::mt19937 random(3);
  for (int k = 0; k < 300; ++k) {
    AnswerReader reader(TwoObservables());
    std::vector<v1::State> states;
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t size = k == 0 ? 1 : 1 + random() % 20;
      reader.Add(std::string_view(text).substr(at, size));
      at += size;
      for (v1::State& state : reader.TakeStates()) states.push_back(std::move(state));
    }
    reader.EndOfInput();
    for (v1::State& state : reader.TakeStates()) states.push_back(std::move(state));
    ASSERT_EQ(Shown(states), expected);
    ASSERT_EQ(reader.ignored_lines(), 4);
    ASSERT_EQ(reader.ignored_samples(), whole.ignored_samples());
  }
}

TEST(AnswerReader, FailsWithASentence) {
  const auto says = [](const std::string& text, const std::string& sentence) {
    const std::string found = FailureOf(text);
    EXPECT_NE(found.find(sentence), std::string::npos) << text << " -> " << found;
  };
  says("{\"load_step\": 1, \"p\": 1, \"q\": 2}\n", "load step 1 is out of order: the first is 0");
  says("{\"load_step\": 0, \"p\": 1}\n{\"load_step\": 1, \"p\": 1, \"q\": 2}\n",
       "load step 1 began, and load step 0 had no q");
  const std::string first = "{\"load_step\": 0, \"p\": 1, \"q\": 2}\n";
  const std::string second = "{\"load_step\": 1, \"p\": 1, \"q\": 2}\n";
  says(first + second + first, "load step 0 is out of order: the last was 1");
  says(first + "{\"load_step\": 2, \"p\": 1, \"q\": 2}\n", "load step 2 is out of order");
  says(first + second + "{\"load_step\": 2, \"p\": 1, \"q\": 2}\n{\"load_step\": 3}\n",
       "load step 3 is beyond the last, 2");
  says("{\"load_step\": -1, \"p\": 1, \"q\": 2}\n", "load_step is no whole number");
  says("{\"load_step\": 0.5, \"p\": 1, \"q\": 2}\n", "load_step is no whole number");
  says("{\"load_step\": \"0\", \"p\": 1, \"q\": 2}\n", "load_step is no whole number");
  says("{\"p\": 1}\n", "has no load_step");
  says("{'load_step': 0}\n", "no JSON object");
  says("{\"end\": \"complete\"}\n", "said that the run is complete with 0 of 3 states");
  says("{\"load_step\": 0, \"p\": \"1\"}\n", "p is no number at load step 0");
  says("{\"load_step\": 0, \"p\": true}\n", "p is no number at load step 0");
  says("{\"load_step\": 0, \"p\": 1}\n{\"load_step\": 0, \"p\": 1.5}\n",
       "p has two values at load step 0: 1 and 1.5");
  says("{" + std::string(2 << 20, ' '), "longer than 1 MiB");
}

TEST(AnswerReader, ALineOfOneMebibyteIsReadAndALongerOneIsNot) {
  for (const std::string end : {"\n", "\r\n"}) {
    std::string line = "{\"load_step\": 0, \"p\": 1, \"q\": 2}";
    line.insert(1, (1 << 20) - line.size(), ' ');
    EXPECT_EQ(Heard(line + end).TakeStates().size(), 1U);
    line.insert(1, " ");
    EXPECT_NE(FailureOf(line + end), "");
  }
}

TEST(AnswerReader, DivergesWhereAnObservableIsNone) {
  const auto reason = [](const std::string& value) {
    const auto end = Heard("{\"load_step\": 0, \"p\": 1, \"q\": " + value + "}\n").end();
    return end.has_value() && end->kind == AnswerEnd::Kind::kDiverged ? end->reason : "";
  };
  EXPECT_EQ(reason("NaN"), "q is NaN at load step 0");
  EXPECT_EQ(reason("-Infinity"), "q is infinite at load step 0");
  EXPECT_EQ(reason("null"), "q is null at load step 0");
  EXPECT_EQ(reason("1"), "");
}

TEST(AnswerReader, NothingCountsAfterAnEnd) {
  AnswerReader reader = Heard("{\"load_step\": 0, \"p\": NaN, \"q\": 2}\n{\"load_step\": 5}\nx\n");
  EXPECT_EQ(reader.end()->kind, AnswerEnd::Kind::kDiverged);
  EXPECT_TRUE(reader.TakeStates().empty());
}

TEST(AnswerReader, ALineThatIsCutOffIsNoFailure) {
  AnswerReader reader = Heard("{\"load_step\": 0, \"p\"");
  reader.EndOfInput();
  EXPECT_FALSE(reader.end().has_value());
}

TEST(AnswerReader, LinesThatAreIgnoredAreNotKept) {
  AnswerReader reader(TwoObservables());
  for (int k = 0; k < 1000; ++k) reader.Add(std::string(100'000, 'x'));
  reader.Add("\n");
  for (int k = 0; k < 1000; ++k) reader.Add("line " + std::to_string(k) + " \xff\x1b\n");
  EXPECT_EQ(reader.ignored_lines(), 1001);
  ASSERT_EQ(reader.ignored_samples().size(), AnswerReader::kMostSamples);
  EXPECT_EQ(reader.ignored_samples()[0].size(), AnswerReader::kLongestSample);
  EXPECT_EQ(reader.ignored_samples()[1], "line 0 ??");
}

TEST(AnswerReader, APersistentProgramSaysItsRunAndItsEnd) {
  Asked asked = TwoObservables(1);
  asked.persistent = true;
  EXPECT_NE(
      FailureOf("{\"load_step\": 0, \"p\": 1, \"q\": 2}\n", asked).find("does not say its run"),
      std::string::npos);
  AnswerReader reader = Heard(
      "{\"run\": \"6\", \"load_step\": 9}\n{\"run\": \"6\", \"end\": \"complete\"}\n"
      "{\"run\": \"7\", \"load_step\": 0, \"p\": 1, \"q\": 2}\n",
      asked);
  EXPECT_EQ(reader.TakeStates().size(), 1U);
  EXPECT_FALSE(reader.said_end());
  reader.Add("{\"run\": \"7\", \"end\": \"complete\"}\n");
  EXPECT_TRUE(reader.said_end());
  EXPECT_EQ(reader.end()->kind, AnswerEnd::Kind::kComplete);

  EXPECT_EQ(FailureOf("{\"run\": \"7\", \"end\": \"complete\"}\n", asked),
            "the program said that the run is complete with 0 of 1 states");
  EXPECT_EQ(FailureOf("{\"run\": \"7\", \"end\": \"lost\", \"reason\": \"why\"}\n", asked),
            "the program ended the run with \"lost\": why");
  const AnswerReader diverged =
      Heard("{\"run\": \"7\", \"end\": \"diverged\", \"reason\": \"too soft\"}\n", asked);
  EXPECT_EQ(diverged.end()->kind, AnswerEnd::Kind::kDiverged);
  EXPECT_EQ(diverged.end()->reason, "too soft");
}

TEST(AnswerReader, ALineMayBeginInOneRunAndEndInTheNext) {
  Asked asked = TwoObservables(1);
  asked.persistent = true;
  AnswerReader reader = Heard("{\"run\": \"7\", \"load_st", asked);
  asked.run = "8";
  reader.BeginRun(asked);
  reader.Add("ep\": 0, \"p\": 1}\n{\"run\": \"8\", \"load_step\": 0, \"p\": 3, \"q\": 4}\n");
  const auto states = reader.TakeStates();
  ASSERT_EQ(states.size(), 1U);
  EXPECT_EQ(states[0].values(0), 3);
}

TEST(AnswerReader, NamesCheckpoints) {
  Asked asked = TwoObservables();
  EXPECT_NE(FailureOf("{\"run\": \"7\", \"checkpoint\": \"c.bin\"}\n", asked), "");
  asked.checkpoint = true;
  AnswerReader reader = Heard("{\"run\": \"7\", \"checkpoint\": \"c.bin\"}\n", asked);
  EXPECT_EQ(reader.TakeCheckpoints(), std::vector<std::string>{"c.bin"});
  EXPECT_FALSE(reader.end().has_value());
}

TEST(AnswerReader, NumbersKeepTheirBits) {
  std::mt19937_64 random(4);
  for (int k = 0; k < 20'000; ++k) {
    const double value = std::bit_cast<double>(random());
    if (!std::isfinite(value)) continue;
    const auto states =
        Heard("{\"load_step\": 0, \"p\": " + NumberText(value) + ", \"q\": 0}\n").TakeStates();
    ASSERT_EQ(std::bit_cast<std::uint64_t>(states.at(0).values(0)),
              std::bit_cast<std::uint64_t>(value));
  }
}

}  // namespace
}  // namespace calib::worker
