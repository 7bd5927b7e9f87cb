#include "server/client/kept_grains.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace calib::client {
namespace {

const GrainsOf kRun = {.campaign = "c1", .sample = 3, .experiment = ""};

TEST(PackingIn, IsThatOfTheLoadStepOrTheLast) {
  const std::string text =
      R"({"sample": 3, "experiment": "tx", "steps": [{"load_step": 0, "cell": {}}, {"load_step": 7}]})";
  const auto last = nlohmann::json::parse(PackingIn(text, kRun, std::nullopt));
  EXPECT_EQ(last["load_step"], 7);
  EXPECT_EQ(last["load_steps"], nlohmann::json({0, 7}));
  EXPECT_EQ(last["campaign"], "c1");
  EXPECT_EQ(nlohmann::json::parse(PackingIn(text, kRun, 0))["load_step"], 0);
  EXPECT_EQ(PackingIn(text, kRun, 5), "");
  EXPECT_EQ(PackingIn(text, {.campaign = "c1", .sample = 4, .experiment = ""}, std::nullopt), "");
  EXPECT_EQ(PackingIn(text, {.campaign = "c1", .sample = 3, .experiment = "ox"}, std::nullopt), "");
}

// Whoever may submit may keep any text under any kind.
TEST(PackingIn, AnyTextIsAPackingOrNone) {
  for (
      const char* text :
      {"", "{", "[]", "3", "null", "{}", R"({"sample": 3})",
       R"({"sample": "3", "experiment": "tx", "steps": []})",
       R"({"sample": 3, "experiment": 3, "steps": []})",
       R"({"sample": 3, "experiment": "tx", "steps": {}})",
       R"({"sample": 3, "experiment": "tx", "steps": [1, "a", null, [], {}]})",
       R"({"sample": 3, "experiment": "tx", "steps": [{"load_step": "7"}, {"load_step": 1.5}]})"}) {
    EXPECT_EQ(PackingIn(text, kRun, std::nullopt), "") << text;
    EXPECT_EQ(PackingIn(text, kRun, 7), "") << text;
  }
}

}  // namespace
}  // namespace calib::client
