#include "worker/program/json_text.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

namespace calib::worker {
namespace {

using Kind = JsonMember::Kind;

TEST(JsonText, MembersInTheirOrder) {
  const auto members = ReadJsonObject(
      R"( { "a" : -1.5e3,"t":"x\"\\\/\b\f\n\r\t\u00e9\ud83d\ude00", "z": null,"y":true, "n":false,
           "in": {"a": [1, {"b": []}], "c": {}}, "a": 2 } )");
  ASSERT_TRUE(members.ok()) << members.status();
  ASSERT_EQ(members->size(), 7U);
  EXPECT_EQ((*members)[0].number, -1500);
  EXPECT_EQ((*members)[1].text, "x\"\\/\b\f\n\r\t\xc3\xa9\xf0\x9f\x98\x80");
  EXPECT_EQ((*members)[2].kind, Kind::kNull);
  EXPECT_EQ((*members)[3].kind, Kind::kTrue);
  EXPECT_EQ((*members)[4].kind, Kind::kFalse);
  EXPECT_EQ((*members)[5].kind, Kind::kInside);
  EXPECT_EQ((*members)[6].name, "a");
  EXPECT_TRUE(ReadJsonObject("{}")->empty());
}

TEST(JsonText, NumbersAsPythonWritesThem) {
  const auto members = *ReadJsonObject(
      R"({"a": NaN, "b": Infinity, "c": -Infinity, "d": 1e400, "e": -1e-400, "NaN": "Infinity"})");
  EXPECT_TRUE(std::isnan(members[0].number));
  EXPECT_EQ(members[1].number, std::numeric_limits<double>::infinity());
  EXPECT_EQ(members[2].number, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(members[3].number, std::numeric_limits<double>::infinity());
  EXPECT_TRUE(members[4].number == 0 && std::signbit(members[4].number));
  EXPECT_EQ(members[5].name, "NaN");
  EXPECT_EQ(members[5].text, "Infinity");
}

TEST(JsonText, WhatIsNone) {
  for (const char* text : {"",
                           "{",
                           "[]",
                           "{\"a\"}",
                           "{\"a\":}",
                           "{\"a\":1,}",
                           "{a:1}",
                           "{\"a\":01}",
                           "{\"a\":1.}",
                           "{\"a\":.5}",
                           "{\"a\":+1}",
                           "{\"a\":1e}",
                           "{\"a\":nan}",
                           "{\"a\":inf}",
                           "{\"a\":1} x",
                           "{\"a\":1}{",
                           "{\"a\":tru}",
                           "{\"a\":\"\\x\"}",
                           "{\"a\":\"\\u12\"}",
                           "{\"a\":\"b}",
                           "{\"a\":'b'}",
                           "{\"a\":-}",
                           "{\"a\":[1,]}",
                           "{\"a\":0x10}",
                           "{\"a\":\"\t\"}"}) {
    EXPECT_FALSE(ReadJsonObject(text).ok()) << text;
  }
  EXPECT_EQ(ReadJsonObject("{\"a\" 1}").status().message(), "expected ':' at column 6");
  EXPECT_FALSE(ReadJsonObject("{\"a\":" + std::string(1'000'000, '[')).ok());
}

// Of texts without NaN what nlohmann-json reads and refuses.
TEST(JsonText, AgreesWithAnotherReader) {
  std::mt19937_64 random(1);
  constexpr std::string_view kPieces[] = {"{",    "}", "\"a\"", "\"b\"", ":",    ",", "1",
                                          "-2.5", "[", "]",     "null",  "true", " ", "\"\\n\""};
  int good = 0;
  for (int k = 0; k < 200'000; ++k) {
    std::string text = "{\"a\":";
    for (auto pieces = random() % 8; pieces > 0; --pieces) {
      text += kPieces[random() % std::size(kPieces)];
    }
    text += "}";
    const auto other = nlohmann::json::parse(text, nullptr, false);
    const auto own = ReadJsonObject(text);
    ASSERT_EQ(own.ok(), !other.is_discarded()) << text;
    good += own.ok() ? 1 : 0;
  }
  EXPECT_GT(good, 1000);
}

TEST(JsonText, EveryDoubleIsReadBackToTheSameBits) {
  std::mt19937_64 random(2);
  for (int k = 0; k < 200'000; ++k) {
    double value = std::bit_cast<double>(random());
    if (k % 4 == 1) {
      value =
          std::trunc(std::ldexp(static_cast<double>(random()), -static_cast<int>(random() % 64)));
    }
    if (k % 4 == 2) value = std::bit_cast<double>(random() & 0x800fffffffffffffULL);  // subnormal
    if (!std::isfinite(value)) continue;
    const std::string text = NumberText(value);
    const auto members = ReadJsonObject("{\"a\": " + text + "}");
    ASSERT_TRUE(members.ok()) << text;
    ASSERT_EQ(std::bit_cast<std::uint64_t>(members->front().number),
              std::bit_cast<std::uint64_t>(value))
        << text;
    char longer[64];  // more digits than needed are rounded correctly
    std::snprintf(longer, sizeof(longer), "%.40e", value);
    ASSERT_EQ(ReadDecimal(longer), value) << longer;
  }
}

TEST(JsonText, DigitsThatDecideAreFarBehind) {
  // Half between 1 and its neighbour: to even; a digit further: up.
  const std::string half = "1.00000000000000011102230246251565404236316680908203125";
  EXPECT_EQ(ReadDecimal(half), 1.0);
  EXPECT_EQ(ReadDecimal(half + std::string(500, '0') + "1"), 1 + 0x1p-52);
  EXPECT_EQ(ReadDecimal("2e-324"), 0.0);
  EXPECT_EQ(ReadDecimal("3e-324"), 5e-324);
  EXPECT_EQ(ReadDecimal("0.0001e400"), std::numeric_limits<double>::infinity());
  EXPECT_EQ(ReadDecimal(std::string(400, '9')), std::numeric_limits<double>::infinity());
  EXPECT_EQ(ReadDecimal("0." + std::string(400, '0') + "1"), 0.0);
  EXPECT_EQ(ReadDecimal("1e99999999999999999999"), std::numeric_limits<double>::infinity());
  EXPECT_EQ(ReadDecimal("0e99999999999999999999"), 0.0);
}

TEST(JsonText, NumbersAreShort) {
  EXPECT_EQ(NumberText(0.1), "0.1");
  EXPECT_EQ(NumberText(1e6), "1000000");
  EXPECT_EQ(NumberText(-3), "-3");
  EXPECT_EQ(NumberText(1e22), "1e+22");
  EXPECT_EQ(NumberText(0), "0");
  EXPECT_EQ(NumberText(-0.0), "-0.0");
}

TEST(JsonText, AnyTextIsReadBack) {
  std::string text;
  for (int c = 0; c < 128; ++c) text += static_cast<char>(c);
  text += "\xc3\xa9";
  EXPECT_EQ(ReadJsonObject("{\"a\": " + QuotedJson(text) + "}")->front().text, text);
}

}  // namespace
}  // namespace calib::worker
