#include "server/page/changes.h"

#include <gtest/gtest.h>

namespace calib::page {
namespace {

v1::Changes Of(const std::string& campaign, std::uint64_t version, std::uint64_t concluded,
               std::uint64_t list) {
  v1::Changes changes;
  v1::Changes::Campaign& one = *changes.add_campaigns();
  one.set_campaign(campaign);
  one.set_version(version);
  one.set_concluded(concluded);
  changes.set_list(list);
  return changes;
}

std::string Stamp(const Changes& changes, Document document, const std::string& campaign = "c1") {
  return changes.StampOf({.document = document, .campaign = campaign});
}

bool Tells(const std::string& events, const std::string& event) {
  return events.find("event: " + event + "\n") != std::string::npos;
}

TEST(Changes, StampsChangeWithWhatADocumentTells) {
  Changes changes("page");
  EXPECT_EQ(Stamp(changes, Document::kCompare), "") << "nobody knows";
  changes.Begin();
  changes.Hear(Of("c1", 5, 3, 2));
  const std::string samples = Stamp(changes, Document::kSamples);
  const std::string compared = Stamp(changes, Document::kCompare);
  const std::string lineage = Stamp(changes, Document::kLineage);
  const std::string other = Stamp(changes, Document::kSamples, "c2");
  EXPECT_EQ(Stamp(changes, Document::kWorkers), "") << "changes all the time";
  changes.Hear(Of("c1", 6, 3, 2));
  EXPECT_NE(Stamp(changes, Document::kSamples), samples);
  EXPECT_EQ(Stamp(changes, Document::kCompare), compared) << "states alone conclude nothing";
  EXPECT_EQ(Stamp(changes, Document::kSamples, "c2"), other);
  changes.Hear(Of("c1", 7, 7, 7));
  EXPECT_NE(Stamp(changes, Document::kCompare), compared);
  EXPECT_NE(Stamp(changes, Document::kLineage), lineage);
}

TEST(Changes, NumbersOfAnotherServerAreOtherNumbers) {
  Changes changes("page");
  changes.Begin();
  changes.Hear(Of("c1", 5, 5, 5));
  const std::string before = Stamp(changes, Document::kCompare);
  changes.Lose();
  EXPECT_EQ(Stamp(changes, Document::kCompare), "");
  changes.Begin();
  changes.Hear(Of("c1", 5, 5, 5));
  EXPECT_NE(Stamp(changes, Document::kCompare), before);
}

TEST(Changes, ABrowserThatReadsSlowlyIsToldOnceOfWhatChangedOften) {
  Changes changes("page");
  changes.Begin();
  const auto feed = changes.NewFeed();
  int woken = 0;
  feed->wake = [&woken] { ++woken; };
  const std::string first = feed->Take();
  EXPECT_TRUE(Tells(first, "hello")) << first;
  EXPECT_NE(first.find("retry: "), std::string::npos);
  EXPECT_EQ(feed->Take(), "");
  changes.Hear(Of("c1", 5, 3, 2));
  changes.Hear(Of("c1", 6, 3, 2));
  changes.Hear(Of("c2", 7, 7, 2));
  EXPECT_EQ(woken, 3);
  const std::string events = feed->Take();
  EXPECT_TRUE(Tells(events, "campaigns"));
  EXPECT_EQ(events.find("\"version\":5"), std::string::npos) << events;
  EXPECT_NE(events.find("\"version\":6"), std::string::npos) << events;
  EXPECT_NE(events.find("\"campaign\":\"c2\""), std::string::npos);
  EXPECT_NE(events.find("id: page-"), std::string::npos);
  EXPECT_EQ(feed->Take(), "");
}

TEST(Changes, ALostServerIsToldAndSoIsItsReturn) {
  Changes changes("page");
  changes.Begin();
  changes.Hear(Of("c1", 5, 3, 2));
  const auto feed = changes.NewFeed();
  EXPECT_NE(feed->Take().find("\"up\":true"), std::string::npos);
  changes.Lose();
  changes.Lose();
  EXPECT_NE(feed->Take().find("event: server\ndata: {\"up\":false}"), std::string::npos);
  changes.Begin();
  const std::string back = feed->Take();
  EXPECT_NE(back.find("event: server\ndata: {\"up\":true}"), std::string::npos) << back;
  EXPECT_NE(back.find("\"campaign\":\"c1\""), std::string::npos)
      << "whatever was shown of it may be another";
}

}  // namespace
}  // namespace calib::page
