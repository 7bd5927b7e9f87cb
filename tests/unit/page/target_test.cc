#include "server/page/target.h"

#include <gtest/gtest.h>

namespace calib::page {
namespace {

using Pieces = std::vector<std::string>;

TEST(Target, IsPiecesAndAQueryDecoded) {
  const auto target = ParseTarget("/api/v1/campaigns/c%31/states/5?limit=3&after=c%209&limit=4");
  ASSERT_TRUE(target.ok()) << target.status();
  EXPECT_EQ(target->path, (Pieces{"api", "v1", "campaigns", "c1", "states", "5"}));
  EXPECT_EQ(target->query.at("limit"), "3") << "the first of two";
  EXPECT_EQ(target->query.at("after"), "c 9");
  EXPECT_TRUE(ParseTarget("/")->path.empty());
  EXPECT_EQ(ParseTarget("/?token=x")->query.at("token"), "x");
  EXPECT_EQ(ParseTarget("/a%2Fb")->path, Pieces{"a/b"}) << "a slash that is part of a name";
  EXPECT_EQ(ParseTarget("//a")->path, (Pieces{"", "a"}));
}

TEST(Target, ThatIsHostileIsRefusedInASentence) {
  for (const std::string text :
       {"", "api", "*", "http://other/", "/%", "/%4", "/%zz", "/a%00b", "/%0d%0aSet-Cookie", "/..",
        "/a/../b", "/%2e%2E", "/.", "/?a=%", "/?%00=1"}) {
    const auto target = ParseTarget(text);
    EXPECT_TRUE(absl::IsInvalidArgument(target.status())) << text;
    EXPECT_FALSE(target.status().message().empty());
  }
  EXPECT_FALSE(ParseTarget("/" + std::string(kLongestTarget, 'a')).ok());
  EXPECT_TRUE(ParseTarget("/" + std::string(kLongestTarget - 1, 'a')).ok());
}

TEST(Cookie, IsFoundByItsWholeName) {
  EXPECT_EQ(CookieIn("a=1; calib-80=xy ;calib-8=z", "calib-80"), "xy");
  EXPECT_EQ(CookieIn("a=1; calib-80=xy", "calib-8"), "");
  EXPECT_EQ(CookieIn("xcalib-80=xy", "calib-80"), "");
  EXPECT_EQ(CookieIn("calib-80", "calib-80"), "");
  EXPECT_EQ(CookieIn("calib-80=a=b", "calib-80"), "a=b");
  EXPECT_EQ(CookieIn(";;;=;", "calib-80"), "");
}

TEST(Host, IsWithoutItsPort) {
  EXPECT_EQ(HostIn("LocalHost:8080"), "localhost");
  EXPECT_EQ(HostIn("127.0.0.1"), "127.0.0.1");
  EXPECT_EQ(HostIn("[::1]:8080"), "[::1]");
  EXPECT_EQ(HostIn(""), "");
}

}  // namespace
}  // namespace calib::page
