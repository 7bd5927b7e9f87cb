// What is sent keeps the rules of its texts, whatever it was made of.
#include "proto/rpc/fit_message.h"

#include <gtest/gtest.h>

#include "calib/v1/campaign.pb.h"
#include "calib/v1/worker.pb.h"
#include "proto/rpc/check_message.h"
#include "proto/rpc/text_kinds.h"

namespace calib::rpc {
namespace {

TEST(FitTexts, AReasonOfMegabytesIsCutAndSaysSo) {
  v1::CampaignStatus status;
  status.set_campaign("c1");
  status.set_reason(std::string(3'000'000, 'x'));
  ASSERT_FALSE(CheckMessage(status).ok());
  FitTexts(status);
  EXPECT_TRUE(CheckMessage(status).ok()) << CheckMessage(status);
  EXPECT_EQ(status.reason().size(), LongestOf(v1::REASON));
  EXPECT_TRUE(status.reason().ends_with("x..."));
}

TEST(FitTexts, WhatKeepsItsRulesKeepsItsBytes) {
  v1::CampaignStatus status;
  status.set_campaign("c1");
  status.set_name("sable d'Hostun, 0,2 MPa – lâche");
  status.set_reason(std::string(LongestOf(v1::REASON), 'x'));
  status.add_effects("rolling_resistance");
  const std::string before = status.SerializeAsString();
  FitTexts(status);
  EXPECT_EQ(status.SerializeAsString(), before);
}

TEST(FitTexts, ReachesTextsInsideMessagesAndLists) {
  v1::WorkerMessage message;
  message.mutable_finished()->set_attempt(1);
  message.mutable_finished()->set_reason(std::string(9000, 'x'));
  FitTexts(message);
  EXPECT_TRUE(CheckMessage(message).ok()) << CheckMessage(message);
  v1::ListReply list;
  v1::CampaignStatus& status = *list.add_campaigns();
  status.set_campaign("c1");
  status.set_purpose("Made By Hand");
  for (int k = 0; k < 300; ++k) status.add_effects("a\nb");
  FitTexts(list);
  EXPECT_TRUE(CheckMessage(list).ok()) << CheckMessage(list);
  EXPECT_EQ(status.purpose(), "_ade__y__and");
  EXPECT_EQ(status.effects_size(), 256);
  EXPECT_EQ(status.effects(0), "a?b");
}

TEST(Fitted, CutsBetweenCharactersAndKeepsUtf8) {
  const std::string of_two = "\u00e9";
  std::string name;
  while (name.size() < 300) name += of_two;
  const std::string fitted = Fitted(v1::NAME, name);
  EXPECT_LE(fitted.size(), LongestOf(v1::NAME));
  EXPECT_GT(fitted.size(), LongestOf(v1::NAME) - 3);
  EXPECT_TRUE(fitted.ends_with(of_two + "..."));
  EXPECT_EQ(Fitted(v1::REASON, "Zeile 3: \xe4"), "Zeile 3: ?") << "Latin-1";
  EXPECT_EQ(Fitted(v1::REASON, "\xed\xa0\x80 \xc0\xaf \xf5"), "??? ?? ?") << "surrogate, overlong";
  EXPECT_EQ(Fitted(v1::REASON, "\u20ac \U0001f600"), "\u20ac \U0001f600");
}

}  // namespace
}  // namespace calib::rpc
